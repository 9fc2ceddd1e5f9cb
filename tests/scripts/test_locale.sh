#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Make locales with other decimal marks, and run tests of the library, and of the Python package, in a host program that
# has set such a locale: all results must stay the same.
#
#     test_locale.sh BUILD_FOLDER PYTHON_TEST...
#
# Exit with 77 if localedef or its sources (Debian's package locales) are missing.
set -eu
build=$1
shift
command -v localedef >/dev/null && [ -e /usr/share/i18n/locales/de_DE ] || { echo "skipped: no localedef"; exit 77; }
export LOCPATH="$build/locales" OPENBLAS_NUM_THREADS=1
export LANGUAGE=en # messages of the C library stay in English, as the tests compare them
mkdir -p "$LOCPATH"
for name in de_DE ps_AF tr_TR; do
  [ -e "$LOCPATH/$name.UTF-8/LC_NUMERIC" ] || localedef -i "$name" -f UTF-8 "$LOCPATH/$name.UTF-8"
done

run() {
  SUPINE_TEST_LOCALE=$1 "$build/tests/test_$2" >"$LOCPATH/log" 2>&1 || [ $? -eq 77 ] || {
    cat "$LOCPATH/log"
    echo "test_$2 fails in $1"
    exit 1
  }
}

# A decimal comma, and a decimal mark of two bytes. The tests check that the mark is really in use.
SUPINE_TEST_MARK='0,5' run de_DE.UTF-8 number
SUPINE_TEST_MARK='0٫5' run ps_AF.UTF-8 number
# In Turkish, i and I are different letters.
for locale in de_DE.UTF-8 ps_AF.UTF-8 tr_TR.UTF-8; do
  for test in base csv state posture golden kriging locate runtime_basis safetensors image mesh_load mesh_save pv_file \
    inside patient fields; do
    [ "$locale" = de_DE.UTF-8 ] || case $test in patient | fields | mesh_load | inside | runtime_basis) continue ;; esac
    run "$locale" "$test"
  done
done
[ $# -eq 0 ] || LC_ALL=de_DE.UTF-8 "$@"
