# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A page that says one thing, for who is not let in or finds nothing, with a way back."""

import html
import http

#: as in panel.css, which who is not let in does not get
_STYLE = """
:root { color-scheme: light dark }
body { font: 16px/1.5 Roboto, sans-serif; margin: 0; background: #eef1f5; color: #17212b }
header { background: #17212b; color: #e8eef4; padding: .8rem 1rem; font-weight: 600 }
main { max-width: 40rem; margin: 1.5rem auto; padding: 1.2rem 1.4rem; background: #fff;
  border-radius: .6rem; border-left: 5px solid #c62828 }
h1 { font-size: 1.15rem; margin: 0 0 .5rem }
p { margin: .4rem 0; overflow-wrap: anywhere }
a { display: inline-block; margin-top: .8rem; padding: .65rem 1rem; border: 1px solid #d8dfe7;
  border-radius: .4rem; color: #0b63b0; font-weight: 600; text-decoration: none }
@media (max-width: 44rem) { main { margin: .6rem } }
@media (prefers-color-scheme: dark) {
  body { background: #10161c; color: #e8eef4 } header { background: #0b1015 }
  main { background: #1a232c } a { color: #6cb4f5; border-color: #2d3743 } }
"""


def plain_page(status: int, reason: str) -> str:
    """Return a page of HTML; the reason is text."""
    title = http.HTTPStatus(status).phrase
    return (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
            f'content="width=device-width"><title>{title} · drive_can panel</title>'
            f'<style>{_STYLE}</style></head><body><header>drive_can panel</header><main>'
            f'<h1>{title}</h1><p>{html.escape(reason[:1].upper() + reason[1:])}.</p>'
            '<a href="/">All drives</a></main></body></html>')
