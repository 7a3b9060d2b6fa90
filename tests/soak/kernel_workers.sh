#!/usr/bin/env bash
# Real-time priority for the kernel's unbound workers for $1 seconds, then not.
until_s=$((SECONDS + $1))
each() { for worker in $(pgrep '^kworker/u'); do chrt "$@" "$worker" 2>/dev/null; done; }
trap 'each -o -p 0; exit' EXIT TERM
while [ "$SECONDS" -lt "$until_s" ]; do
    each -f -p 45
    sleep 1
done
