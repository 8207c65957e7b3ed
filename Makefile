# Everything a person or a CI job calls. Each target brings its own set-up; stamp files make a second call quick.
SHELL := /bin/bash
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
TORCH := torch==2.13.0
TORCH_CPU := https://download.pytorch.org/whl/cpu
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

RUNTIME := $(VENV)/.stamp-runtime
DEV := $(VENV)/.stamp-dev
SYSTEM := $(VENV)/.stamp-system

HOST ?= 127.0.0.1
PORT ?= 7860
WORKERS ?= 2
TESTS ?= tests
SYSTEM_NAME ?= lgtok
LIBRARY ?= library
RUNS ?= runs
DATA ?= $(PLAYGROUND_DATA)
DATA_NAME ?= motions-22
SIZE ?= cpu
MINUTES ?=
THREADS ?= 2
QUEUE = --library $(LIBRARY) --size $(SIZE) $(if $(MINUTES),--minutes $(MINUTES))

.PHONY: help setup app test notebooks figures train family others ablations ablations-others bench benchpage benchendless lint format screenshots clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 24

setup: $(DEV) $(SYSTEM) ## install everything: run-time and dev requirements, a browser and off-screen GL for the tests

app: $(RUNTIME) ## start the web app on HOST and PORT (run-time requirements only)
	$(BIN)/python -m playground app --host $(HOST) --port $(PORT)

test: $(DEV) $(SYSTEM) ## run the tests (TESTS=path for a part, WORKERS=n processes)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(TESTS)

lint: $(DEV) ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(DEV) ## let ruff format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

notebooks: $(DEV) ## execute every notebook; what they show is in build/notebooks, the notebooks themselves stay without outputs
	@mkdir -p build/notebooks
	$(BIN)/jupyter execute --output='../build/notebooks/{notebook_name}' --timeout=1800 notebooks/*.ipynb

figures: $(DEV) $(LIBRARY)/library.json ## make the stored results that are missing or of other checkpoints (hours; stops and goes on at will)
	$(BIN)/python -m playground.evaluation.published.contents --library $(LIBRARY)
	$(BIN)/python -m playground.evaluation.published --library $(LIBRARY)

$(LIBRARY)/library.json: | $(DEV)
	$(BIN)/python -m playground prepare joints-npz $(DATA) --out $(LIBRARY) --name $(DATA_NAME)

train: $(DEV) $(LIBRARY)/library.json ## train SYSTEM_NAME: its tokenizer, its generator, then a refit of the detokenizer; goes on where it stopped (DATA=folder makes LIBRARY)
	$(BIN)/python -m playground train $(SYSTEM_NAME)-tokenizer --library $(LIBRARY) --out $(RUNS)/$(SYSTEM_NAME) --resume
	$(BIN)/python -m playground train $(SYSTEM_NAME)-generator --library $(LIBRARY) --out $(RUNS)/$(SYSTEM_NAME) --resume
	$(BIN)/python -m playground train $(SYSTEM_NAME)-refit --library $(LIBRARY) --out $(RUNS)/$(SYSTEM_NAME) --resume

family: $(DEV) $(LIBRARY)/library.json ## train the LG-Tok family, what is missing of it (SIZE=cpu or gpu, MINUTES=n); stops and goes on at will
	$(BIN)/python -m playground.training.train_family $(QUEUE)

others: $(DEV) $(LIBRARY)/library.json ## train the other papers' systems, what is missing of them (MINUTES); stops and goes on at will
	$(BIN)/python -m playground.training.train_others --library $(LIBRARY) $(if $(MINUTES),--minutes $(MINUTES))

ablations: $(DEV) $(LIBRARY)/library.json ## train and measure the ablations, one after another (SIZE, MINUTES); stops and goes on at will
	$(BIN)/python -m playground.training.ablations $(QUEUE)

ablations-others: $(DEV) $(LIBRARY)/library.json ## the same for the other papers' systems (MINUTES); stops and goes on at will
	$(BIN)/python -m playground.training.ablations_others --library $(LIBRARY) $(if $(MINUTES),--minutes $(MINUTES))

bench: $(RUNTIME) ## measure speed and memory
	$(BIN)/python -m playground bench

benchendless: $(RUNTIME) ## measure five minutes of endless motion: speed, memory, seams (THREADS=n)
	$(BIN)/python -m benchmarks.endless $(THREADS)

benchpage: $(DEV) $(SYSTEM) ## measure how quick the page is to a visitor, in a headless browser
	$(BIN)/python -m benchmarks.page

screenshots: $(DEV) $(SYSTEM) ## photograph every room of the app into screenshots/
	$(BIN)/python -m tests.browser.screenshots

clean: ## remove caches; the virtual environment, libraries and runs stay
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis build
	find playground tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +

# The virtual environment. Debian splits venv from python3: where it is missing and apt is there, it is installed.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed; name one with: make setup PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { $(APT_INSTALL) python3-venv; } || true
	$(PYTHON) -m venv $(VENV)

# torch first: the small CPU build where its index answers, else the build that the default index has.
$(RUNTIME): requirements.txt | $(BIN)/python
	$(PIP) install --retries 0 --timeout 5 --index-url $(TORCH_CPU) $(TORCH) 2>/dev/null || $(PIP) install $(TORCH)
	$(PIP) install -r requirements.txt
	@touch $@

$(DEV): requirements-dev.txt $(RUNTIME)
	$(PIP) install -r requirements-dev.txt
	@touch $@

# A browser and off-screen GL, for browser tests and pictures. Without apt, or without the right to use it, they are
# left to the person: a note says so, and what needs them says so again when it is called.
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo -n)
APT_INSTALL = command -v apt-get >/dev/null && $(SUDO) apt-get -qq update \
	&& $(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends

$(SYSTEM): | $(BIN)/python
	@wanted=""; \
	command -v chromium >/dev/null || command -v chromium-browser >/dev/null || wanted="$$wanted chromium"; \
	libraries=$$(/sbin/ldconfig -p 2>/dev/null || true); \
	grep -q 'libEGL\.so\.1' <<<"$$libraries" || wanted="$$wanted libegl1"; \
	grep -q 'libGL\.so\.1' <<<"$$libraries" || wanted="$$wanted libgl1"; \
	grep -q 'libOSMesa\.so\.8' <<<"$$libraries" || wanted="$$wanted libosmesa6"; \
	if [ -n "$$wanted" ]; then \
	  { $(APT_INSTALL) $$wanted >/dev/null; } || echo "note: not installed:$$wanted (browser tests and pictures need them)" >&2; \
	fi
	@touch $@
