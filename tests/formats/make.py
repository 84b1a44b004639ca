"""Writes table.csv as other programs do: pip install pandas pyarrow scipy; python make.py

table.csv is the beginning of the recording that `bristle demo` makes.
"""

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

table = pd.read_csv("table.csv")
pq.write_table(pa.Table.from_pandas(table, preserve_index=False), "pyarrow.parquet")
signals = {name.split("[")[0]: column.to_numpy() for name, column in table.items()}
scipy.io.savemat("scipy.mat", signals | {"gain": 1.0, "note": "text"}, do_compression=True)
table.loc[99, "u[N*m]"] = None
pq.write_table(pa.Table.from_pandas(table, preserve_index=False), "gap.parquet")
