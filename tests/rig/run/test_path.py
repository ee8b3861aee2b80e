"""The path of a run in the order of docs/path.md, then the whole loop in virtual time."""

import math

import msgspec
import numpy as np
import pytest

from comms.messages import (
    AngleSample,
    Command,
    Frame,
    InvalidReason,
    JointState,
    LinkAngle,
    Phase,
    Reference,
    RobotState,
    SwingPlane,
    Truth,
    Verb,
    axis_state,
)
from rig.analysis.analyze import RunAnalysis
from rig.run import config, experiment
from rig.run.config import Experiment
from rig.run.job import plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.tasks.controller.joints import robot_joints
from rig.run.tasks.controller.task import ControllerSettings, ControllerTask
from rig.run.tasks.streamer import Streamer
from vision.task import VisionTask

MS = 1_000_000
SHORT = ["experiment.quiet_s=0.6", "experiment.watch_s=4", "record.pictures_hz=1"]


def loaded(*changes):
    return config.read_experiment("move", [*SHORT, *changes])


def sent(step, channel):
    return [send.message for send in step.sends if send.channel == channel]


def order(verb, to, t_ns, t_start_ns=0):
    return Command(seq=0, t_ns=t_ns, id=1, to=to, verb=verb, t_start_ns=t_start_ns)


def resting(seq, t_ns, x_m=0.0, cls=RobotState):
    place, still = (x_m, 0.0, 0.0), (0.0, 0.0, 0.0)
    if cls is JointState:
        return axis_state(seq, t_ns, place, still)
    return RobotState(
        seq=seq,
        t_ns=t_ns,
        t_actual_ns=t_ns,
        commanded_m=place,
        actual_m=place,
        actual_velocity_m_s=still,
        phase=Phase.IDLE,
    )


# 1 config


def test_an_experiment_keeps_model_and_plant_apart():
    chosen = loaded()
    assert chosen.model.length_m == 1.0
    assert bench.params(chosen).pendulum.length_m == 0.98


# 2 planner


def test_the_plan_of_the_experiment_ends_at_rest_where_it_should():
    motion = plan_move(loaded()).motion
    assert motion.duration_s == pytest.approx(1.5)
    assert motion.at(motion.duration_s) == pytest.approx([0.2, 0.0, 0.0], abs=1e-12)
    assert motion.at(motion.duration_s, 1) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


# 3 job


def test_every_task_gets_its_settings_and_the_bench_alone_gets_the_plant():
    job = prepare(loaded(), plan_move(loaded()), bench.plant(loaded()))
    encoded = {
        name: msgspec.json.encode(settings).decode() for name, settings in job.settings.items()
    }
    assert set(encoded) == {"bench", "controller", "vision", "streamer"}
    assert "0.98" in encoded["bench"]
    assert not any(
        "0.98" in words or "pitch" in words for name, words in encoded.items() if name != "bench"
    )


# 4 streamer


def test_the_streamer_plays_the_plan_on_its_grid():
    chosen = loaded()
    plan = plan_move(chosen)
    streamer = Streamer(prepare(chosen, plan, bench.plant(chosen)).settings["streamer"])
    streamer.start(0)
    streamer.on_message("robot_state", resting(0, 0), 0)
    streamer.on_message("command", order(Verb.ARM, "streamer", 0), 0)
    streamer.on_message("command", order(Verb.START, "streamer", 0, 60 * MS), 0)
    t_ns = 60 * MS + 1_000 * MS  # 0.4 s into the move
    for k in range(100):
        tick_ns = 60 * MS + k * 10 * MS
        streamer.on_message("angle_1", seen(k, tick_ns), tick_ns)
        streamer.on_message("robot_state", resting(k + 1, tick_ns), tick_ns)
        streamer.on_tick(tick_ns)
    (reference,) = sent(streamer.on_tick(t_ns), "reference")
    assert reference.t_target_ns == t_ns
    assert reference.position_m[0] == pytest.approx(float(plan.motion.x.at(0.4)), abs=1e-12)


def seen(seq, t_ns, angle_rad=0.0):
    cable = LinkAngle(
        angle_rad=angle_rad, sigma_rad=1e-5, raw_rad=angle_rad, offset_rad=0.0, joint_px=None
    )
    return AngleSample(
        seq=seq,
        t_ns=t_ns,
        t_valid_ns=t_ns,
        swing_plane=SwingPlane.X,
        valid=True,
        reason=InvalidReason.NONE,
        platform_m=0.0,
        rows=480,
        residual_px=0.03,
        pivot_miss_px=0.0,
        background=200.0,
        saturation=0.0,
        links=(cable,),
    )


# 5 controller


def test_the_controller_turns_a_reference_into_six_even_setpoints():
    controller = ControllerTask(ControllerSettings(reference_stale_ns=300 * MS))
    controller.start(0)
    controller.on_message("joint_state", resting(0, 5 * MS, cls=JointState), 5 * MS)
    controller.on_message("command", order(Verb.ARM, "controller", 6 * MS), 6 * MS)
    controller.on_message("command", order(Verb.START, "controller", 7 * MS, 60 * MS), 7 * MS)
    reference = Reference(seq=0, t_ns=50 * MS, t_target_ns=50 * MS, position_m=(0.003, 0.0, 0.0))
    controller.on_message("reference", reference, 50 * MS)
    steps = [controller.on_tick(t * MS) for t in range(60, 90, 5)]
    places = [setpoint.position_m[0] for step in steps for setpoint in sent(step, "setpoint")]
    assert places == pytest.approx([0.0005, 0.001, 0.0015, 0.002, 0.0025, 0.003])
    assert [len(sent(step, "platform_1")) for step in steps] == [1, 0, 1, 0, 1, 0]


# 6 bench: robot, pendulum, camera


def test_the_bench_moves_swings_the_load_back_and_shows_it():
    chosen = loaded("controller.policy=source")  # a step of 10 mm would stop the robot
    settings = prepare(chosen, plan_move(chosen), bench.plant(chosen)).settings
    plant = bench.task(settings["bench"])
    plant.start(0)
    joints = robot_joints(settings["controller"].robot)
    plant.on_message("setpoint", joints.setpoint(0, 3 * MS, (0.01, 0.0, 0.0)), 3 * MS)
    sends = [send for t in range(5, 205, 5) for send in plant.on_tick(t * MS).sends]
    states = [s.message for s in sends if s.channel == "joint_state"]
    truths = [s.message for s in sends if s.channel == "truth"]
    frames = [s.message for s in sends if s.channel == "frame_1"]
    platform = joints.platform(states[-1])
    assert platform.position_m[0] == pytest.approx(0.01, abs=1e-4)  # the servos have settled
    angles_rad = [truth.links[0].angle_x_rad for truth in truths]
    assert min(angles_rad) < -5e-3  # a push to the right leaves the load behind
    assert [f.t_exposure_start_ns for f in frames[:3]] == [0, 20 * MS, 40 * MS]
    assert frames[0].pixels.shape == (480, 640)


# 7 camera -> tracker -> offset table -> filter


def test_the_tracker_sees_what_the_camera_shows_at_the_instant_it_says():
    changed = loaded("bench.pendulum.initial_swing_rad=0.03")
    settings = prepare(changed, plan_move(changed), bench.plant(changed)).settings
    plant, vision = bench.task(settings["bench"]), VisionTask(settings["vision"])
    vision.start(0)
    truth, angles = {}, []
    sends = list(plant.start(0).sends)
    for t in range(5, 505, 5):
        sends += plant.on_tick(t * MS).sends
    for _, message, at_ns in sends:
        if isinstance(message, Truth):
            truth[message.t_ns] = message.links[0].angle_x_rad
        elif isinstance(message, JointState):
            vision.on_message("platform_1", resting(0, message.t_ns), at_ns)
        elif isinstance(message, Frame):
            angles += sent(vision.on_message("frame_1", message, at_ns + 8 * MS), "angle_1")
    stamps = sorted(truth)
    expected = np.interp([a.t_valid_ns for a in angles], stamps, [truth[t] for t in stamps])
    assert all(a.valid for a in angles)
    measured = np.array([a.cable.angle_rad for a in angles])
    # 1 degree of pitch without the distance of the camera: 0.015 %
    assert measured == pytest.approx(expected, abs=0.1e-3)


# 8 recorder -> analysis


def test_what_the_recorder_writes_the_analysis_reads(tmp_path):
    job = prepare(loaded(), plan_move(loaded()), bench.plant(loaded()))
    start = {"run_id": "r", "mode": "virtual", "experiment": "move", "kind": "move"}
    recorder = Recorder(tmp_path / LOG, start, job.attachments(), 0)
    recorder.message("command", order(Verb.START, "streamer", 5, 60 * MS), 5)
    recorder.message("angle_1", seen(0, 7, 0.01), 9)
    recorder.close({}, {"exit_status": "ok", "exit_code": "0"}, 10)
    run = RunAnalysis(tmp_path / LOG).run
    assert run.t_start_s == pytest.approx(0.06)
    assert run.angles == [seen(0, 7, 0.01)]
    assert (
        msgspec.json.decode(run.log.attachments["experiment.json"], type=Experiment)
        == job.experiment
    )


# the whole loop


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    ran = experiment.run(loaded(), "virtual", tmp_path_factory.mktemp("runs"), quietly, quietly)
    return RunAnalysis(ran.folder / LOG)


def quietly(*_):
    return None


def test_the_loop_ends_well_and_every_packet_is_accounted_for(whole):
    assert (whole.summary.exit_status, whole.summary.verdict, whole.summary.reasons) == (
        "ok",
        "good",
        [],
    )
    assert {name: row.unexplained for name, row in whole.summary.links.items()} == dict.fromkeys(
        whole.summary.links, 0
    )
    assert len(whole.summary.links) == 8
    assert whole.summary.lateness.references_late == 0


def test_the_run_finds_the_two_centimetres_that_the_model_is_off(whole):
    length, sigma = whole.summary.measured.cable_length_m, whole.summary.sigma.cable_length_m
    assert length == pytest.approx(0.98, abs=max(5 * sigma, 1e-4))
    assert whole.summary.measured.residual_swing_rad == pytest.approx(
        whole.summary.truth.residual_swing_rad, rel=0.02
    )


def test_the_measured_swing_is_true_at_its_stamps_without_any_fitted_delay(whole):
    assert whole.summary.swing_error.outside_move_rad < 0.05e-3
    assert whole.summary.swing_error.during_move_rad < 0.45e-3


def test_the_latencies_are_those_of_the_source_rig(whole):
    assert whole.summary.latency_ms.vision == pytest.approx(
        35.0, abs=0.1
    )  # 5 exposure + 8 link + 2 processing + 20 average
    assert 50 < whole.summary.latency_ms.command < 70


def test_a_plan_with_the_true_length_leaves_almost_no_residual_swing(tmp_path):
    ran = experiment.run(
        loaded("bench.pendulum.length_m=1.0"), "virtual", tmp_path, quietly, quietly
    )
    assert RunAnalysis(ran.folder / LOG).summary.truth.residual_swing_rad < 0.6e-3


def test_equal_seeds_give_equal_digests_and_other_seeds_others(tmp_path):
    brief = ["experiment.quiet_s=0.6", "experiment.watch_s=0.2", "move.time_s=1.5"]
    digests = []
    for seed in (1, 1, 2):
        chosen = config.read_experiment("move", [*brief, f"experiment.seed={seed}"])
        digests.append(experiment.run(chosen, "virtual", tmp_path, quietly, quietly).outcome.digest)
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]


def test_a_free_decay_gives_frequency_and_damping_without_a_model_of_them(tmp_path):
    ran = experiment.run(
        config.read_experiment("free_decay", []), "virtual", tmp_path, quietly, quietly
    )
    summary = RunAnalysis(ran.folder / LOG).summary
    truth = math.sqrt(9.81 / 0.9624) / (2 * math.pi)
    assert summary.measured.natural_frequency_hz == pytest.approx(truth, rel=1e-5)
    assert summary.measured.damping_ratio == pytest.approx(0.000237, rel=0.01)


def test_a_run_continues_through_dropouts_and_a_lossless_twin_is_recorded(tmp_path):
    chosen = config.read_experiment("dropouts", SHORT)
    ran = experiment.run(chosen, "virtual", tmp_path, quietly, quietly)
    lossy, twin = RunAnalysis(ran.folder / LOG), RunAnalysis(ran.twin / LOG)
    reference = lossy.summary.links["reference"]
    assert 0.05 < reference.lost / reference.sent < 0.4
    assert reference.lost == reference.lost_link
    assert twin.summary.links["reference"].lost == 0
    assert farthest_from_plan_m(lossy.run) > 1.5 * farthest_from_plan_m(twin.run)


def farthest_from_plan_m(run):
    _, _, t, actual = run.robot.T
    return float(np.abs(actual - run.planned_m(t)).max())
