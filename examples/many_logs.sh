#!/bin/sh
# The verdict on each compass of many logs, one line a log: a script works with --json and the exit code.
# sh examples/many_logs.sh logs/*.tlog
# Why a log cannot be fitted is said on stderr as it happens, and at the end which ones and with what
# exit code; then this script ends with 2. (`magcomp fleet` does more: docs/fleet.md.)
failed=0
names=
for log in "$@"; do
    answer=$(magcomp fit "$log" --json)
    code=$?
    # 1 is an answer too: the judge rejects it.
    if [ $code -le 1 ]; then
        printf '%s' "$answer" | python3 -c '
import json, sys
found = json.load(sys.stdin)
print(found["source"], *(str(c["compass"]) + ":" + c["verdict"] for c in found["compasses"]))
' || code=2
    fi
    [ $code -ge 128 ] && exit $code # interrupted
    if [ $code -gt 1 ]; then
        failed=$((failed + 1))
        names="$names
  $log: exit code $code"
    fi
done
[ $failed -eq 0 ] && exit 0
echo "$failed of $# logs failed:$names" >&2
exit 2
