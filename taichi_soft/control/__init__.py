"""A game's changes to bodies between two steps: check the arguments, then call one kernel."""
