"""Pulls the tissue upwards, and draws force against depth (pull.png; pull.csv without matplotlib).

usage: python3 examples/pull.py http://127.0.0.1:8090/#TICKET
"""

import sys
import time

import numpy as np

import palpate

DEPTH_M, STEPS, STEP_S = 0.03, 60, 0.05

with palpate.join(sys.argv[1], name="pull.py") as session:
    up = np.array(session.hello["up"])
    radius_m = session.hello["tools"][session.tool or 0]["radius_m"]
    shape_m = session.frame().positions_m
    top = shape_m[np.argmax(shape_m @ up)]  # the highest point [3], m

    # from above to where the tool touches, then close it
    for height_m in np.linspace(0.02 + radius_m, 0.8 * radius_m, 20):
        session.move(top + height_m * up)
        time.sleep(STEP_S)
    start = top + 0.8 * radius_m * up
    session.move(start, grasp=True)
    time.sleep(0.3)

    depth_m, force_N = np.linspace(0, DEPTH_M, STEPS), []
    for depth in depth_m:
        pose = session.move(start + depth * up, grasp=True)
        time.sleep(STEP_S)  # the tissue follows
        force_N.append(-session.force_N(after=pose) @ up)  # of the tool on the tissue
    session.lift()

print(f"{force_N[-1]:.3f} N at {1000 * DEPTH_M:g} mm")
try:
    import matplotlib.pyplot as plot

    plot.plot(1000 * depth_m, force_N)
    plot.xlabel("depth, mm")
    plot.ylabel("force, N")
    plot.savefig("pull.png")
except ImportError:
    np.savetxt("pull.csv", np.column_stack([depth_m, force_N]), delimiter=",", header="depth_m,force_N", comments="")
