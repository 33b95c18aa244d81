# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.

PYTHON ?= python3
VENV := .venv
# makes the environment, and names its folder
SETUP = .ci/setup '$(PYTHON)' '$(VENV)'

# Nothing that runs from here leaves this machine, unless you say otherwise.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

.PHONY: help demo test check-stops setup bench pictures lint clean
.NOTPARALLEL:
.DEFAULT_GOAL := help

help:
	@echo 'make demo    simulated drives, a bridge and the live view; ARGS="..." goes to drive_can demo'
	@echo 'make test    all tests; ARGS="..." goes to pytest (-n 1: one after the other)'
	@echo '             DRIVE_CAN_TEST_PROFILE=long: all places and more chance, as in CI;'
	@echo '             DRIVE_CAN_TEST_SEED=...: for the same random examples again'
	@echo 'make check-stops  stories of stops, judged from the motor, without end; ARGS="--kind ... --seed ..."'
	@echo 'make bench   measurements; ARGS="..." goes to bench/run.py'
	@echo 'make pictures  those of README and docs, from a demo that runs'
	@echo 'make lint    style and types'
	@echo 'make setup   only the virtual environment that all of them use, in $(VENV) or beside it; the demo'
	@echo '             makes half of it. What you add to it stays.'
	@echo 'make clean   removes it, if nothing runs from it, and everything else that was built'
	@echo
	@echo 'With ROS 2 Jazzy or Kilted sourced, that one is used; otherwise it comes as wheels (Linux on'
	@echo 'x86-64), those of Jazzy; ROS_DISTRO_WHEELS=kilted: those of Kilted, in an environment of their own.'
	@echo 'PYTHON=... says which Python, 3.10 to 3.13.'

setup:
	@$(SETUP) >/dev/null

# Ctrl-C ends the demo, which ends well, and so does make.
demo:
	@venv=$$($(SETUP) demo) && exec $$venv/bin/python .ci/foreground $$venv/bin/drive_can demo $(ARGS)

test:
	@.ci/test '$(PYTHON)' '$(VENV)' $(ARGS)

check-stops:
	@venv=$$($(SETUP)) && exec $$venv/bin/python .ci/foreground $$venv/bin/python test/bench/stop_checker.py $(ARGS)

bench:
	@venv=$$($(SETUP)) && exec $$venv/bin/python .ci/foreground $$venv/bin/python bench/run.py $(ARGS)

pictures:
	@venv=$$($(SETUP)) && exec $$venv/bin/python docs/pictures.py $(ARGS)

lint:
	@venv=$$($(SETUP)) && exec .ci/lint "$$venv"

clean:
	@.ci/clean '$(VENV)'
