#!/bin/sh
# Creates the environment $1 if it does not exist, and installs taichi-soft with the extra $2 (demo, lab, test, dev).
# Uses uv if it is installed, otherwise venv and pip. PYTHON=/path/to/python sets the interpreter.
set -eu

venv=$1
extra=$2
fail() {
    echo "taichi-soft: $1" >&2
    exit 1
}
no_install="the packages could not be installed, for the reason above (without a network, configure an index or a cache for pip)"
supported='import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))'
installing="installing taichi-soft[$extra] and its dependencies (once; takes minutes if the package cache is empty)"

if [ -z "${PYTHON:-}" ] && command -v uv >/dev/null 2>&1; then
    if [ ! -x "$venv/bin/python" ]; then
        echo "1/2 creating the environment $venv"
        uv venv --quiet --python ">=3.10,<3.14" "$venv" || fail "uv found no Python 3.10 to 3.13. Install one."
    fi
    echo "2/2 $installing"
    uv pip install --python "$venv/bin/python" -e ".[$extra]" || fail "$no_install"
    exit 0
fi

if [ ! -x "$venv/bin/pip" ]; then
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 python3.10 python}; do
        if command -v "$candidate" >/dev/null 2>&1; then
            found=$candidate
            if "$candidate" -c "$supported" >/dev/null 2>&1; then
                python=$candidate
                break
            fi
        fi
    done
    if [ -z "${python:-}" ]; then
        [ -n "${found:-}" ] || fail "no Python found. Install Python 3.10, 3.11, 3.12 or 3.13."
        version=$("$found" -c 'import platform; print(platform.python_version())' 2>/dev/null || echo "of unknown version")
        fail "$found is Python $version, for which Taichi has no wheels. Install Python 3.10 to 3.13, or name one: make PYTHON=python3.12 test"
    fi
    "$python" -c 'import venv, ensurepip' >/dev/null 2>&1 ||
        fail "$python has no venv module. Install it (Debian and Ubuntu: apt install python3-venv)."

    echo "1/2 creating the environment $venv with $("$python" --version)"
    rm -rf "$venv"
    "$python" -m venv --without-pip "$venv" || fail "$python could not create $venv, for the reason above"
    # Faster than ensurepip: the interpreter's own pip installs pip together with the packages.
    if "$python" -m pip --python "$venv/bin/python" --version >/dev/null 2>&1; then
        echo "2/2 $installing"
        "$python" -m pip --python "$venv/bin/python" install --no-compile --disable-pip-version-check pip -e ".[$extra]" ||
            fail "$no_install"
        exit 0
    fi
    "$venv/bin/python" -m ensurepip >/dev/null || fail "$python could not install pip into $venv, for the reason above"
fi

echo "2/2 $installing"
"$venv/bin/python" -m pip install --no-compile --disable-pip-version-check -e ".[$extra]" || fail "$no_install"
