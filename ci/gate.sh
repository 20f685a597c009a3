#!/usr/bin/env bash
# Runs a campaign and compares it with an earlier one: what the GitHub action and the GitLab template do.
#
#   gate.sh VAST_FILE BASE REPORTS [OPTION...] [-- RUN-OPTION...]
#
# BASE is a folder with the campaign to compare with; when it is missing, as at the first time, the
# gate passes. The new campaign goes to REPORTS/campaign. OPTIONs are those of `vast results
# compare`, RUN-OPTIONs those of `vast exec local run`. Into REPORTS go runs.xml and gate.xml (JUnit), and gate.md (a comment). The exit code is
# that of the comparison; a campaign that could not be run ends the gate with its own.
set -euo pipefail
if [ $# -lt 3 ]; then
  echo "usage: gate.sh VAST_FILE BASE REPORTS [OPTION...] [-- RUN-OPTION...]" >&2
  exit 2
fi
file=$1 base=$2 reports=$3
shift 3
options=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do
  options+=("$1")
  shift
done
[ $# -eq 0 ] || shift

if [ -n "$(ls -A "$reports/campaign" 2>/dev/null)" ]; then
  echo "error: $reports/campaign holds a campaign already; name another folder for reports." >&2
  exit 2
fi
mkdir -p "$reports/campaign"
code=0
vast -V "$file" exec local run "$reports/campaign" "$@" || code=$?
case $code in
  0 | 1 | 4) ;; # what did not pass is for the comparison to judge
  *) exit "$code" ;;
esac
vast results junit "$reports/campaign" "$reports/runs.xml"
if [ -z "$(ls -A "$base" 2>/dev/null)" ]; then
  echo "There is no earlier campaign to compare with." | tee "$reports/gate.md"
  exit 0
fi
vast results compare "$base" "$reports/campaign" \
  --junit "$reports/gate.xml" --markdown "$reports/gate.md" "${options[@]}"
