// Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
//
// What the panel does in the browser: what a person asks of a drive goes to the panel as a request
// of its own, whatever the state of the page's WebSocket; charts keep their points here.
'use strict';

const panel = (() => {
  // the token has become a cookie: keep it out of what is seen, copied and remembered
  const address = new URL(location.href);
  if (address.searchParams.has('token')) {
    address.searchParams.delete('token');
    history.replaceState(history.state, '', address);
  }

  // what a page without its panel shows is old, and is not to look as if it were not
  let told = false;
  const timeOfDay = () => new Date().toTimeString().slice(0, 8);
  let since = timeOfDay();  // when the panel was last heard: it has sent the page
  setInterval(async () => {
    const there = Boolean(window.socket && window.socket.connected);
    document.body.classList.toggle('lost', !there);
    if (there) since = timeOfDay();
    connecting(!there);
    if (there || told) return;
    // a panel that was started again has other tokens: the page would try to reach it for ever
    const answer = await ask('/panel/icon.svg', {cache: 'no-store'});
    if (answer.response && answer.response.status === 401 && !told) {
      told = true;
      tell(false, answer.text);
    }
  }, 1000);

  // why everything is grey: it stands above the page, which is what it was
  function connecting(lost) {
    let line = document.getElementById('connecting');
    if (!lost) return line && line.remove();
    if (!line) {
      line = document.createElement('div');
      line.id = 'connecting';
      line.setAttribute('role', 'status');
      const page = document.querySelector('.page');
      if (!page) return;
      page.before(line);
    }
    line.textContent = `connecting… what is shown is of ${since}`;
  }

  // -- requests -----------------------------------------------------------------------------------

  // failed: the lines that the text begins with
  function tell(success, text, stays, failed = []) {
    const told = document.createElement('div');
    told.className = `told ${success ? 'ok' : 'error'}`;
    told.setAttribute('role', success ? 'status' : 'alert');
    text.split('\n').forEach((line, place) => {
      const shown = document.createElement('div');
      shown.className = place < failed.length ? 'failed' : '';
      shown.textContent = line;
      told.append(shown);
    });
    told.title = 'click to close';
    told.addEventListener('click', () => told.remove());
    let list = document.getElementById('told');
    if (!list) {
      list = document.createElement('div');
      list.id = 'told';
      document.body.append(list);
    }
    list.append(told);
    while (list.children.length > 4) list.firstChild.remove();
    // what went wrong stays until it is read
    if (success && !stays) setTimeout(() => told.remove(), 6000);
    return told;
  }

  async function ask(path, options) {
    try {
      const response = await fetch(path, {credentials: 'same-origin', ...options});
      const kind = response.headers.get('content-type') || '';
      if (kind.startsWith('application/json')) return await response.json();
      return {success: response.ok, text: await response.text(), response};
    } catch (error) {
      return {success: false, text: 'the panel does not answer: is drive_can panel still running?'};
    }
  }

  const send = (action, fields) => ask(`/do/${action}`, {
    method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(fields)});

  async function stop(action, drive, name) {
    let waiting;
    const late = setTimeout(() => {
      waiting = tell(false, `${name}: no answer to ${action.replace('_', ' ')} yet: `
        + 'may still be running');
    }, 5000);
    const answer = await send(action, {drive});
    clearTimeout(late);
    if (waiting) waiting.remove();
    const text = answer.text || `${action.replace('_', ' ')} done`;
    // of all drives, those that do not stand are named in the answer
    const all = drive === '*';
    tell(answer.success, all ? text : `${name}: ${text}`, all, answer.failed);
  }

  async function write(drive, name, row) {
    const field = row.querySelector('input');
    const place = row.querySelector('.answer');
    place.className = 'answer';
    place.textContent = 'writing …';
    const answer = await send('write', {drive, name, value: field.value});
    place.classList.add(answer.success ? 'ok' : 'error');
    place.textContent = answer.success ? `written${answer.text ? ': ' + answer.text : ''}`
      : answer.text;
  }

  // -- backups ------------------------------------------------------------------------------------

  async function backup(drive, button) {
    button.disabled = true;
    const path = `/do/backup?drive=${encodeURIComponent(drive)}`;
    let answer;
    try {
      const response = await fetch(path, {credentials: 'same-origin'});
      answer = response.ok ? await response.blob() : await response.text();
    } catch (error) {
      answer = 'the panel does not answer';
    }
    button.disabled = false;
    if (typeof answer === 'string') return tell(false, answer);
    const link = document.createElement('a');
    link.href = URL.createObjectURL(answer);
    link.download = `${drive.slice(1).replaceAll('/', '_')}.yaml`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  const carry = (action, drive, file) => ask(`/do/${action}?drive=${encodeURIComponent(drive)}`, {
    method: 'POST', headers: {'Content-Type': 'application/yaml'}, body: file});

  function dialog(title, text) {
    const box = document.createElement('dialog');
    const heading = document.createElement('h2');
    const words = document.createElement('pre');
    const close = document.createElement('button');
    heading.textContent = title;
    words.textContent = text;
    close.textContent = 'Close';
    close.className = 'plain';
    close.addEventListener('click', () => box.close());
    box.addEventListener('close', () => box.remove());
    box.append(heading, words, close);
    document.body.append(box);
    box.showModal();
    return box;
  }

  function compare(drive, mayRestore) {
    const chooser = document.createElement('input');
    chooser.type = 'file';
    chooser.className = 'chooser';
    chooser.accept = '.yaml,.yml';
    chooser.addEventListener('change', async () => {
      const file = chooser.files[0];
      chooser.remove();
      if (!file) return;
      const box = dialog(`${drive.slice(1)} and ${file.name}`, 'reading the drive …');
      const answer = await carry('compare', drive, file);
      box.querySelector('pre').textContent = answer.text;
      if (!answer.success || !mayRestore) return;
      const restore = document.createElement('button');
      restore.textContent = 'Restore: write what differs to the drive';
      restore.className = 'danger';
      const warning = document.createElement('p');
      warning.textContent = 'Restoring writes settings at once. Make sure that the drive stands '
        + 'still: the panel does not ask again, also where nobody knows whether it is enabled.';
      restore.addEventListener('click', async () => {
        restore.disabled = true;
        box.querySelector('pre').textContent = 'restoring …';
        const answer = await carry('restore', drive, file);
        box.querySelector('pre').textContent = answer.text;
        restore.remove();
        warning.remove();
      });
      box.insertBefore(warning, box.querySelector('button'));
      box.append(restore);
    });
    document.body.append(chooser);
    chooser.click();
  }

  // -- charts -------------------------------------------------------------------------------------

  const KEPT = 600e3;  // ms
  const charts = new Map();

  function chart(id) {
    if (!charts.has(id)) {
      charts.set(id, {series: new Map(), paused: false, span: 60e3, newest: 0});
    }
    return charts.get(id);
  }

  // series: [{name, unit, points: [[ms, value], …]}]: what is new; others are no longer wanted
  function plot(id, now, series) {
    const one = chart(id);
    one.newest = now;
    const shown = () => [...one.series].map(([name, each]) => `${name} ${each.unit}`).join();
    const before = shown();
    for (const name of [...one.series.keys()]) {
      if (!series.some((each) => each.name === name)) one.series.delete(name);
    }
    for (const each of series) {
      let kept = one.series.get(each.name);
      // another unit: of a bridge that runs with another configuration now
      if (!kept || kept.unit !== each.unit) kept = {unit: each.unit, points: []};
      const last = kept.points.length ? kept.points[kept.points.length - 1][0] : 0;
      for (const point of each.points) if (point[0] > last) kept.points.push(point);
      while (kept.points.length && kept.points[0][0] < now - KEPT) kept.points.shift();
      one.series.set(each.name, kept);
    }
    const changed = before !== shown();
    if (changed || !one.paused) draw(id, changed);
  }

  // a value that does not change has an axis around it, not one that begins at 0
  function narrow() {
    const end = ({min, max}, sign) => {
      if (max > min || !isFinite(min)) return null;
      const room = 0.05 * Math.abs(min) || 1;
      const step = 10 ** Math.floor(Math.log10(room));
      return Number((Math.round((min + sign * room) / step) * step).toPrecision(6));
    };
    return {min: (found) => end(found, -1), max: (found) => end(found, 1)};
  }

  function draw(id, changed) {
    const one = chart(id);
    const element = getElement(id);
    if (!element || !element.chart || document.hidden) return;
    const dark = document.body.classList.contains('body--dark');
    const ink = dark ? '#b9c4d0' : '#4a5563';
    const units = [...new Set([...one.series.values()].map((each) => each.unit))];
    const end = one.paused ? one.pausedAt : one.newest;
    const options = {
      xAxis: {min: end - one.span, max: end},
      series: [...one.series].map(([name, each]) => ({
        name: each.unit ? `${name} [${each.unit}]` : name, type: 'line', showSymbol: false,
        animation: false, yAxisIndex: units.indexOf(each.unit), data: each.points,
        lineStyle: {width: 2}})),
    };
    if (changed) {
      options.yAxis = units.map((unit, place) => ({
        type: 'value', name: unit, scale: true, ...narrow(), position: place % 2 ? 'right' : 'left',
        offset: 46 * Math.floor(place / 2), nameTextStyle: {color: ink},
        axisLabel: {color: ink}, splitLine: {show: place === 0,
          lineStyle: {color: dark ? '#2d3743' : '#e3e8ee'}}}));
      if (!options.yAxis.length) options.yAxis = [{type: 'value'}];
      options.grid = {left: 50 + 46 * Math.max(0, Math.ceil(units.length / 2) - 1),
        right: units.length > 1 ? 50 + 46 * (Math.floor(units.length / 2) - 1) : 16,
        top: 56, bottom: 64};
      options.legend = {type: 'scroll', top: 0, textStyle: {color: ink}};
      options.xAxis.axisLabel = {color: ink, hideOverlap: true};
    }
    element.chart.setOption(options, changed
      ? {replaceMerge: ['series', 'yAxis']} : undefined);
  }

  function pause(id, button) {
    const one = chart(id);
    one.paused = !one.paused;
    one.pausedAt = one.newest;
    button.textContent = one.paused ? 'Go on' : 'Pause';
    button.setAttribute('aria-pressed', one.paused);
    if (!one.paused) draw(id, false);
  }

  function span(id, seconds) {
    chart(id).span = 1e3 * seconds;
    const element = getElement(id);
    if (element && element.chart) {
      element.chart.dispatchAction({type: 'dataZoom', start: 0, end: 100});
    }
    draw(id, false);
  }

  return {stop, write, backup, compare, plot, pause, span};
})();
