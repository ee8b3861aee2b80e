"""Examples at the end of `--help`, by verb: two command lines without the word `rig`.

They run as they stand, given what they name: a file of points, a recorded run, a video.
"""

from __future__ import annotations

EXAMPLES = {
    "doctor": (
        "doctor",
        "doctor --experiment move --json",
    ),
    "plan": (
        "plan --planner zv --time 2 --length 0.98",
        "plan --model jerk --robust length --time 2.5 --csv plan.csv",
    ),
    "compare": (
        "compare 3.1",
        "compare free_cart --plot cart.svg",
    ),
    "run": (
        "run move --virtual --seed 7",
        "run --planner matrix_exponential,zv --virtual --set model.length_m=0.98",
    ),
    "stop": (
        "stop",
        "stop --emergency",
    ),
    "sim": (
        "sim --video v.avi --truth t.csv",
        "sim --video v.avi --truth t.csv --seconds 2 --set bench.camera.pitch_deg=0",
    ),
    "track": (
        "track v.avi --csv angles.csv",
        "track --benchmark --scenes clean,no_cable --frames 50",
    ),
    "analyze": (
        "analyze last",
        "analyze last --csv swing.csv --report",
    ),
    "recover": (
        "recover last whole.mcap",
        "recover runs/broken.mcap whole.mcap --json",
    ),
    "export": (
        "export last --csv tables",
        "export last --csv tables --parquet tables",
    ),
    "laws": (
        "laws",
        "laws compare --distance 0.2 --vmax 1 --amax 5",
    ),
    "laws compare": (
        "laws compare --distance 0.2 --vmax 1 --amax 5",
        "laws compare --jmax 60 --load-length 0.98 --json",
    ),
    "laws plot": (
        "laws plot cycloidal modified_sine",
        "laws plot --plot all.pdf",
    ),
    "spline": (
        "spline points.csv --time 2",
        "spline points.csv --vmax 3 --amax 2 --plot motion.svg",
    ),
    "motor-check": (
        "motor-check --example 1",
        "motor-check --example 1 --time 3.2 --plot plane.svg",
    ),
    "size": (
        "size --example appendix",
        "size --example appendix --entry 20x40 --plot chart.svg",
    ),
    "servo": (
        "servo compare --controllers pid,lqg --truth listed",
        "servo notch --detune 0.95",
    ),
    "servo compare": (
        "servo compare --controllers pid,lqg --truth listed",
        "servo compare --pareto --points 3 --plot front.svg",
    ),
    "servo notch": (
        "servo notch",
        "servo notch --antiresonance 150 --detune 0.95 --plot notch.svg",
    ),
    "servo observer": (
        "servo observer --joint fitted",
        "servo observer --time-constants 5e-4,2e-3 --order 2",
    ),
    "servo shaping": (
        "servo shaping",
        "servo shaping --shapers zv,ei --sample-time 0.001",
    ),
    "study": (
        "study dropouts --planners zv --seeds 2",
        "study dropouts --policies bounded --losses 0.2 --burst 10 --seeds 1",
    ),
    "study dropouts": (
        "study dropouts --planners zv --seeds 2",
        "study dropouts --losses 0,0.1 --seeds 2 --plot dropouts.svg --json",
    ),
    "study source004": (
        "study source004 --only 3.33,3.37",
        "study source004 --page source004.html",
    ),
    "calibrate": (
        "calibrate offsets --virtual",
        "calibrate camera boards.avi --out camera.toml",
    ),
    "calibrate camera": (
        "calibrate camera boards.avi --marks marks.png --places marks.csv --out camera.toml",
        "calibrate camera --lens camera.toml --marks moved.png --places marks.csv",
    ),
    "calibrate offsets": (
        "calibrate offsets --virtual",
        "calibrate offsets --experiment free_decay --virtual --out offsets.toml",
    ),
    "can": (
        "can scan",
        "can monitor --seconds 2",
    ),
    "can scan": (
        "can scan",
        "can scan --interface socketcan --channel can0 --bitrate 500000",
    ),
    "can monitor": (
        "can monitor --seconds 2",
        "can monitor --from last --dbc run --count 100",
    ),
    "can sdo": (
        "can sdo 1 6064",
        "can sdo 1 6065 20000 --type u32 --interface socketcan --channel can0",
    ),
}
