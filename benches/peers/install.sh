#!/usr/bin/env bash
# Installs the programs that benches/peers/run.py compares with, from Debian's and Python's registries. What cannot be
# installed is named and left out. Run it as often as you like; as root for the Debian packages.
set -uo pipefail
cd "$(dirname "$0")/../.."
venv=target/peers/venv
missing=()

# FreeFEM; PETSc under dolfinx; OpenBLAS, without which Debian's CHOLMOD is slow; what scikit-sparse is built on.
debian=(freefem++ libfreefem++ python3-dolfinx-real python3-petsc4py-real libopenblas0-pthread libsuitesparse-dev
    gcc python3-dev python3-venv)
for package in "${debian[@]}"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' && continue
    [ -n "${updated:-}" ] || { updated=yes; apt-get update -qq; }
    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends "$package" >/dev/null || missing+=("$package")
done

# One virtual environment for the rest; Debian's Python, so that its headers fit.
python=/usr/bin/python3
[ -x "$python" ] || python=python3
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv" || missing+=("a virtual environment in $venv")
# mkl brings NGSolve's pardiso; scikit-sparse brings CHOLMOD to scikit-fem, 0.4.16 being the last that builds on SuiteSparse 5.
for package in numpy scipy scikit-fem pyamg ngsolve mkl scikit-sparse==0.4.16; do
    "$venv/bin/pip" install -q --disable-pip-version-check "$package" || missing+=("$package")
done

if [ ${#missing[@]} -eq 0 ]; then
    echo "all peers are installed"
else
    printf 'could not be installed: %s\n' "${missing[@]}"
fi
