"""Control of bodies between two steps. Each function checks its arguments, then calls one kernel."""
