#!/bin/sh
# The verdict on each compass of many logs, one line a log: a script works with --json and the exit code.
# sh examples/many_logs.sh logs/*.tlog
for log in "$@"; do
    magcomp fit "$log" --json 2>/dev/null | python3 -c '
import json, sys
text = sys.stdin.read()
if text:
    found = json.loads(text)
    print(found["source"], *(str(c["compass"]) + ":" + c["verdict"] for c in found["compasses"]))
' || exit 1
done
