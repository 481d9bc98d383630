# %% [markdown]
# # An archive
#
# `wheelplane batch` measures every capture of an archive, resumes where it was stopped, and keeps a catalogue of the results. Here
# three vehicles are made, measured, and looked at as one table.

# %%
import tempfile
from pathlib import Path

import pandas as pd

folder = Path(tempfile.mkdtemp())

# %%
# !wheelplane synth {folder}/archive/car-1 --seed 1 --trials 0
# !wheelplane synth {folder}/archive/car-2 --seed 2 --trials 0
# !wheelplane synth {folder}/archive/car-3 --seed 3 --trials 0

# %%
# !wheelplane batch {folder}/archive -o {folder}/results

# %% [markdown]
# ## The results as a table
#
# One row a capture and quantity; degrees and metres.

# %%
# !wheelplane results {folder}/results --csv {folder}/results.csv
table = pd.read_csv(folder / "results.csv")
table.head()

# %% [markdown]
# ## Asked with SQL
#
# The catalogue is read only: a query cannot change it.

# %%
# !wheelplane results {folder}/results --sql "SELECT name, status, points_total FROM captures"

# %% [markdown]
# ## Summary
#
# Mean and scatter of each quantity over the archive.

# %%
# !wheelplane results {folder}/results --summary
