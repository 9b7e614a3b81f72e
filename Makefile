# make demo   the head verges on a simulated target, and a report is written to out/demo
# make test   every test
# make lint   ruff format and lint, mypy
# make bench  every benchmark (ONLY=name for one), results in out/bench
# make soak   goals every five seconds for an hour (DURATION_S=300 for five minutes): memory, threads, descriptors
# make study  docs/metric_study.md anew, from the simulator
# make setup  only the environment and the build
# All of these make .venv and install/ first, or find them ready, with the versions of requirements/lock.txt.
# make lock   the newest versions into requirements/lock.txt (ARGS=--keep: only what the requirements make necessary)
SHELL := /bin/bash
.DEFAULT_GOAL := demo
.PHONY: setup setup-dev demo test lint bench soak study lock clean

setup:
	@bash tools/bootstrap.sh run

setup-dev:
	@bash tools/bootstrap.sh dev

demo: setup
	@source env.sh && exec vergence demo $(ARGS)

test: setup-dev
	@source env.sh && exec python -m pytest $(ARGS)

lint: setup-dev
	@source env.sh && ruff format --check . && ruff check . && mypy

bench: setup-dev
	@source env.sh && exec python -m bench $(if $(ONLY),--only $(ONLY))

soak: setup-dev
	@source env.sh && exec python -m bench.soak $(DURATION_S)

study: setup-dev
	@source env.sh && exec python tools/metric_study.py

lock:
	@bash tools/lock.sh $(ARGS)

clean:
	rm -rf .venv build install log out
