"""Adaptive Runge-Kutta pair that places its points as in the source's shooting."""

from __future__ import annotations

import numpy as np

from planners.trajectories.pieces import FloatArray

RELATIVE_TOLERANCE = 1e-3  # defaults of ode45, as in the source
ABSOLUTE_TOLERANCE = 1e-6
REFINE = 4  # points reported for each step
ORDER = 5

# Dormand and Prince (1980), order 5(4): the last row is also the solution
STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
# Interpolant of order 4: coefficients of the powers 1 to 4 of the share of a step, a row per stage
INTERPOLANT = np.array(
    [
        [1, -183 / 64, 37 / 12, -145 / 128],
        [0, 0, 0, 0],
        [0, 1500 / 371, -1000 / 159, 1000 / 371],
        [0, -125 / 32, 125 / 12, -375 / 64],
        [0, 9477 / 3392, -729 / 106, 25515 / 6784],
        [0, -11 / 7, 11 / 3, -55 / 28],
        [0, 3 / 2, -4, 5 / 2],
    ]
)


def ode45(
    matrix: FloatArray, start: FloatArray, duration_s: float
) -> tuple[FloatArray, FloatArray]:
    """Integrate y' = matrix y; return times (m,) and states (m, n).

    Points are the ends of the steps and REFINE - 1 points within each. Step control of Shampine and
    Reichelt, "The MATLAB ODE suite" (1997): the error is relative to the larger |y| before and
    after a step, at least ABSOLUTE_TOLERANCE / RELATIVE_TOLERANCE; a step is at most a tenth of the
    duration.
    """
    longest = 0.1 * duration_s
    t, y = 0.0, start
    floor = ABSOLUTE_TOLERANCE / RELATIVE_TOLERANCE
    steepness = np.max(np.abs(matrix @ y) / np.maximum(np.abs(y), floor)) / (
        0.8 * RELATIVE_TOLERANCE ** (1 / ORDER)
    )
    step = min(longest, 1.0 / float(steepness)) if steepness > 0 else longest
    times, states = [np.zeros(1)], [y[None]]
    shares = np.arange(1, REFINE + 1) / REFINE
    powers = shares[:, None] ** np.arange(1, 5)  # (REFINE, 4)
    failed = False
    while t < duration_s:
        step = min(longest, step)
        last = 1.1 * step >= duration_s - t
        if last:
            step = duration_s - t
        slopes, new = _stages(matrix, y, step)
        size = np.maximum(np.maximum(np.abs(y), np.abs(new)), floor)
        error = step * float(np.max(np.abs(ERROR @ slopes) / size))
        if error > RELATIVE_TOLERANCE:
            # a second failure in a row halves the step
            ratio = 0.8 * (RELATIVE_TOLERANCE / error) ** (1 / ORDER)
            step *= 0.5 if failed else max(0.1, ratio)
            failed = True
            continue
        times.append(t + step * shares)
        states.append(y + step * (powers @ INTERPOLANT.T) @ slopes)
        states[-1][-1] = new
        t = duration_s if last else t + step
        y = new
        if not failed:
            step /= max(0.2, 1.25 * (error / RELATIVE_TOLERANCE) ** (1 / ORDER))
        failed = False
    times[-1][-1] = duration_s
    return np.concatenate(times), np.concatenate(states)


def _stages(matrix: FloatArray, y: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Compute the slopes (7, n) of one step and its end state (n,)."""
    slopes = np.zeros((7, len(y)))
    slopes[0] = matrix @ y
    new = y
    for k, weights in enumerate(STAGES, start=1):
        new = y + step * (np.array(weights) @ slopes[:k])
        slopes[k] = matrix @ new
    return slopes, new
