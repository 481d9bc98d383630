# %% [markdown]
# # A whole vehicle
#
# Four scans, one a wheel, give the frame of the vehicle, toe and camber of each wheel, and what follows from them. The result is
# compared with five surveyed points a wheel.

# %%
import json
import tempfile
from pathlib import Path

import wheelplane as wp

folder = Path(tempfile.mkdtemp())

# %%
# !wheelplane synth {folder}/capture --seed 1

# %% [markdown]
# ## Measured
#
# A capture is a folder, zip or tar with a scan of each wheel. Arrays, paths, Open3D and trimesh clouds are taken as well:
# `wp.measure({"RR": rr, "RL": rl, "FR": fr, "FL": fl}, target="disc-250")`.

# %%
m = wp.measure(folder / "capture")
m.table().head(12)

# %% [markdown]
# Each value has its expanded uncertainty U for 95 %, its coverage factor and degrees of freedom.

# %%
toe = m.wheels["FL"].toe
print(toe)
print(f"{60 * toe.deg:+.2f}' with U {60 * toe.U_deg:.2f}'")

# %% [markdown]
# ## Against the truth
#
# The vehicle is synthetic, so its true angles are known. Errors in standard uncertainties should lie within 2 in 95 of 100.

# %%
truth = {
    w["name"]: w for w in json.loads((folder / "capture" / "truth.json").read_text())["wheels"]
}
for name in ("RR", "RL", "FR", "FL"):
    found = m.wheels[name]
    for quantity in ("toe", "camber"):
        value = getattr(found, quantity)
        error = value.deg - truth[name][f"{quantity}_deg"]
        print(
            f"{name} {quantity:6}  error {3600 * error:+6.1f} arc seconds, {error / value.u_deg:+.2f} u"
        )

# %% [markdown]
# Toe of two wheels shares the frame, and so part of its error: the covariance tells how much.

# %%
m.covariance["FL.toe", "FR.toe"] / (m["FL.toe"].u * m["FR.toe"].u)

# %% [markdown]
# ## Against five points

# %%
five_points = wp.read_five_point(folder / "capture" / "five-point.txt")
comparison = wp.validate(m, five_points)
comparison.verdict

# %% [markdown]
# ## The report
#
# An alignment shows itself as its report; `m.save(FOLDER)` writes it with `measurement.json` and the pictures.

# %%
print(m.text())
