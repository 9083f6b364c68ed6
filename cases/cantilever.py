"""The study of the paper under a short name: `python -m cases.cantilever`."""

import runpy

if __name__ == "__main__":
    runpy.run_module("cases.verification.cantilever", run_name="__main__", alter_sys=True)
