"""Run the command line for `python -m taichi_soft`."""

from taichi_soft.cli import main

main()
