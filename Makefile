# make setup | demo | test | check | docs | format | bench: each sets up what it needs and is quick the second time.
# make test-oldest: a second environment in .venv-oldest. make clean: removes both environments.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
OLDEST := .venv-oldest
READY := $(VENV)/.ready
ROOMS := comms planners vision sim_rig rig
SHORT :=
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

.PHONY: setup setup-oldest demo test test-oldest wheel check docs format bench endurance mutants clean

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "need $(PYTHON) on the PATH (or: make PYTHON=/path/to/python3.11+)"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

# in real time where this machine keeps it, else in virtual time
demo: $(READY)
	$(BIN)/rig run move --clock auto

test: $(READY)
	$(THREADS) $(BIN)/python -m pytest -n 2 --dist loadgroup

# the same tests with the oldest versions that pyproject.toml admits, but for those that these cannot change: commands
# of the README, long trials, runs in real time, and physics in plain Python
OLDEST_LEAVES_OUT := $(addprefix --ignore=tests/,test_readme_commands.py test_endurance.py rig/run/test_wall_loop.py \
  rig/run/test_drive_wall.py rig/run/test_drive_faults.py rig/run/test_drive_bench.py rig/run/test_envelope.py \
  rig/run/test_joint_run.py rig/run/test_loads.py rig/run/test_quattro_run.py rig/run/test_buffered.py \
  rig/run/test_path.py rig/studies/test_dropouts.py rig/studies/test_servo_friction.py rig/studies/test_servo_pareto.py \
  rig/studies/test_servo_compare.py rig/studies/test_low_speed_ripple.py rig/studies/test_source_004.py \
  rig/studies/test_source_004_links.py rig/studies/test_free_cart.py rig/studies/test_kit_page.py \
  rig/studies/test_scenes.py rig/studies/test_kit.py rig/studies/test_compare.py rig/studies/test_sizing_file.py \
  rig/ui/test_track_benchmark.py rig/ui/test_page.py rig/ui/test_report.py rig/ui/test_planner_list.py \
  rig/ui/test_running_run.py rig/ui/test_size_command.py rig/ui/test_stop_command.py rig/ui/test_sim_command.py \
  rig/ui/test_servo_shaping_command.py rig/ui/test_servo_notch_command.py rig/ui/test_screw_chart.py \
  vision/test_cable_shapes.py comms/test_other_readers.py rig/ui/test_command_line.py rig/run/test_virtual_ledger.py \
  planners/test_boundary_value_numerical.py rig/run/test_waypoints.py \
  rig/run/test_two_cameras.py rig/ui/test_calibrate_command.py rig/ui/test_calibrate_camera_command.py \
  rig/ui/test_help.py rig/ui/test_law_commands.py \
  rig/ui/test_track_command.py rig/ui/test_tune_command.py rig/run/test_static_scene.py rig/run/test_bench_faults.py \
  comms/test_wall_runner.py comms/test_strangers.py rig/run/test_bounded.py rig/run/test_setpoint_gate.py \
  rig/run/test_interpolator.py rig/run/test_streamer.py rig/run/test_safety.py rig/run/test_controller.py \
  rig/run/test_following.py rig/run/test_operator_process.py rig/run/test_starvation.py rig/run/test_run_out.py \
  vision/test_video_tracker.py vision/test_look_findings.py vision/test_tracked.py vision/test_scene_check.py \
  rig/ui/test_report_in_browser.py rig/ui/test_servo_observer_command.py) \
  $(addprefix --ignore=,$(filter-out tests/sim_rig/test_bench_camera.py,$(wildcard tests/sim_rig/test_*.py)) \
  $(wildcard tests/rig/drives/test_cia402_*.py))
setup-oldest: $(OLDEST)/.ready

$(OLDEST)/.ready: pyproject.toml constraints-oldest.txt
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints-oldest.txt -e '.[tests]'
	@touch $@

test-oldest: setup-oldest
	$(THREADS) $(OLDEST)/bin/python -m pytest -n 2 --dist loadgroup $(OLDEST_LEAVES_OUT)

wheel: pyproject.toml  # the wheel works from another folder, in an environment of its own
	rm -rf build/wheel && mkdir -p build/wheel
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps -w build/wheel .
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt build/wheel/swayless-*.whl
	cd build/wheel && venv/bin/rig doctor
	cd build/wheel && venv/bin/rig run --virtual --no-report
	cd build/wheel && { venv/bin/rig size --example appendix; test $$? = 3; }
	cd build/wheel && venv/bin/rig compare 3.1

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy $(ROOMS)
	$(BIN)/lint-imports

# pages that are generated: the wire, and the scenes with their pictures
docs: $(READY)
	$(BIN)/python -m comms.wire_page > docs/wire.md
	$(BIN)/python -m rig.studies.vision.scene_page docs

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# SHORT=--short: few repeats, to check that the benchmarks run
bench: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[peers]'
	$(THREADS) $(BIN)/python -m benchmarks.loop $(SHORT)
	$(THREADS) $(BIN)/python -m benchmarks.planning $(SHORT)
	$(THREADS) $(BIN)/python -m benchmarks.servo $(SHORT)
	$(THREADS) $(BIN)/python -m benchmarks.identification --records 20 $(SHORT)

# long trials of the running system, outside CI (kills needs root); SHORT=--short: a few of each
endurance: $(READY)
	$(BIN)/python -m endurance.fuzz $(SHORT)
	$(BIN)/python -m endurance.stops $(SHORT)
	$(BIN)/python -m endurance.strangers $(SHORT)
	$(BIN)/python -m endurance.kills $(SHORT)

# make mutants FILE=comms/link.py SHARD=1/2: small changes of a file, each to be noticed by a test
SHARD := 1/1
mutants: $(READY)
	$(BIN)/python -m endurance.mutants $(FILE) --shard $(SHARD)

clean:
	rm -rf $(VENV) $(OLDEST) build *.egg-info
