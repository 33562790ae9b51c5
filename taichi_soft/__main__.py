"""`python -m taichi_soft`: the command line."""

from taichi_soft.cli import main

main()
