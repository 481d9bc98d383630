# %% [markdown]
# # One scan
#
# A scan of one wheel shows the target, the wheel behind it, the floor. This notebook finds the target, looks at its plane and
# centre, and asks how well both are known.

# %%
import tempfile
from pathlib import Path

import numpy as np

import wheelplane as wp

folder = Path(tempfile.mkdtemp())

# %% [markdown]
# A synthetic capture serves as the scan: its angles and centres are known. With your own scanner, read the points with what you
# like; an array of rows x y z in metres is enough.

# %%
# !wheelplane synth {folder}/capture --seed 1

# %%
import open3d

cloud = open3d.io.read_point_cloud(str(folder / "capture" / "fl.ply"))
points = np.asarray(cloud.points)
points.shape

# %% [markdown]
# ## The planes of the scan
#
# `find_planes` takes any cloud, knows no target, and returns the planes with the most points first.

# %%
for plane in wp.find_planes(points)[:3]:
    print(plane)

# %% [markdown]
# ## The target
#
# `find_target` looks for the outline of the target: here a disc of 250 mm. Its centre is fitted to the edge, never the mean of the
# points, which are denser on the side of the scanner.

# %%
target = wp.find_target(points, "disc-250")
target

# %%
print("centre", target.centre_m, "m")
print("normal", target.normal)

# %% [markdown]
# `covariance` says how well: of the normal, then of the centre. The roots of its diagonal are standard uncertainties along x, y, z.

# %%
1e6 * np.sqrt(np.diag(target.covariance)[3:])  # micrometres

# %% [markdown]
# ## What the scan does not show
#
# With every tenth point the angles are known some three times less well; the program says so.

# %%
thin = wp.find_target(points[::10], "disc-250")
thin_m2, all_m2 = (np.trace(one.covariance[3:, 3:]) for one in (thin, target))
np.sqrt(thin_m2 / all_m2)

# %% [markdown]
# A cloud without a target is refused in one line, which says what to do.

# %%
try:
    wp.find_target(np.random.default_rng(0).uniform(size=(5000, 3)), "disc-250")
except wp.WheelplaneError as error:
    print(error)
