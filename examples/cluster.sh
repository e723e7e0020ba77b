#!/bin/sh
# Start a dask scheduler and WORKERS=2 workers on this machine, run a command of hapticeval on them, and end them:
#   examples/cluster.sh run thesis -o results
# Renderers of your own are imported from the current directory.
set -eu

here=$(mktemp -d)
export DASK_CONFIG="${DASK_CONFIG:-$(cd "$(dirname "$0")" && pwd)/dask.yaml}"
started=
finish() {
  for pid in $started; do kill "$pid" 2>/dev/null || true; done
  { sleep 10; for pid in $started; do kill -9 "$pid" 2>/dev/null || true; done; } >/dev/null 2>&1 & # one that does not end
  for pid in $started; do wait "$pid" 2>/dev/null || true; done
  kill "$!" 2>/dev/null || true
  rm -rf "$here"
}
trap finish EXIT
trap 'exit 130' INT TERM

dask scheduler --host 127.0.0.1 --port 0 --no-dashboard --scheduler-file "$here/scheduler.json" 2>"$here/scheduler.log" &
scheduler=$!
started=$scheduler
while [ ! -s "$here/scheduler.json" ]; do
  kill -0 "$scheduler" 2>/dev/null || { cat "$here/scheduler.log" >&2; exit 2; }
  sleep 0.2
done
address=$(sed -n 's/.*"address": "\([^"]*\)".*/\1/p' "$here/scheduler.json")

dask worker "$address" --nworkers "${WORKERS:-2}" --nthreads 1 --no-dashboard --local-directory "$here" \
  2>"$here/workers.log" &
started="$! $started"

code=0
hapticeval "$@" --scheduler "$address" || code=$?
exit "$code"
