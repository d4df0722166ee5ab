#!/bin/bash
# Simulates an eight-hour shift of a machining centre in 48 s. thermocompd reads its thermocouples and the
# height of its head over Modbus and compensates the tool's displacement. At the end: a plot, and the
# remaining error. All files are written to demo_output/.
#   ./demo.sh body      afterwards: the shift in three dimensions, for a browser; builds the modelling tools
#   ./demo.sh fleet     instead: twelve machines of one type, two weeks, a private PostgreSQL; two minutes
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
source scripts/common.sh

if [[ ${1:-} == fleet ]]; then
  stage "packages" scripts/setup.sh demo_fleet
  stage "configure" cmake --preset release
  stage "build" cmake --build --preset release -j "$(build_jobs)" \
    --target thermocomp thermocomp-modelling thermocomp-fleet thermocomp-uplink thermocompd thermocomp-sim
  exec "$python" scripts/demo_fleet.py build/release/bin demo_output
elif [[ $# -gt 1 || -n ${1:-} && $1 != body ]]; then
  echo "usage: ./demo.sh [body|fleet]" >&2
  exit 2
fi

bin=build/release/bin
out=demo_output
time_factor=600
shift_s=48
sim_pid='' daemon_pid='' watch_pid=''

fail() {
  echo "demo: $*" >&2
  exit 1
}

end_processes() {
  local pid
  for pid in "$watch_pid" "$daemon_pid" "$sim_pid"; do
    [[ -z $pid ]] || kill "$pid" 2>/dev/null || true
  done
  wait 2>/dev/null || true
  rm -rf "$run"
}
# Sockets and links to pseudo terminals: short paths on a file system that supports them.
run=$(mktemp -d)
trap end_processes EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# eventually SECONDS "what" COMMAND...: waits until the command succeeds.
eventually() {
  local deadline=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    ((SECONDS < deadline)) || fail "$what (logs: $out/*.log)"
    sleep 0.1
  done
}

is_running() { kill -0 "$1" 2>/dev/null; }

prepare() {
  mkdir -p "$out"
  rm -f "$out"/{history.db*,state.json,truth.csv,ports.json,*.log,demo.png,demo.svg,body.html,shift.csv}
}

simulated_machine_is_ready() {
  is_running "$sim_pid" || fail "the simulated machine ended: $(tail -n 1 "$out/thermocomp-sim.log")"
  [[ -s $out/ports.json ]]
}

daemon_answers() {
  is_running "$daemon_pid" || fail "thermocompd ended: $(tail -n 1 "$out/thermocompd.log")"
  local status=0
  "$bin/thermocomp" --socket "$run/status.sock" status >/dev/null 2>&1 || status=$?
  ((status < 2))
}

has_ended() { ! is_running "$1"; }

# Free port chosen by the simulated machine for a bus.
port_of() { sed -n "s/.*\"$1\":\([0-9]\+\).*/\1/p" "$out/ports.json"; }

start_simulated_machine() {
  "$bin/thermocomp-sim" config/demo/machine.toml --time-factor "$time_factor" \
    --start-on-heartbeat --port cabinet=0 --port cnc=0 --path "column_line=$run/column_line" \
    --truth "$out/truth.csv" --ports-file "$out/ports.json" >"$out/thermocomp-sim.log" 2>&1 &
  sim_pid=$!
  eventually 20 "the simulated machine does not get ready" simulated_machine_is_ready
}

start_daemon() {
  local sensors_port controller_port
  sensors_port=$(port_of cabinet)
  controller_port=$(port_of cnc)
  [[ -n $sensors_port && -n $controller_port ]] || fail "no ports in $out/ports.json"
  cp config/demo/model.toml "$out/model.toml"
  sed -e "s/^port = 15020\$/port = $sensors_port/" -e "s/^port = 15030\$/port = $controller_port/" \
    -e "s#^device = \"/.*\"#device = \"$run/column_line\"#" \
    -e "s#\"demo_output/status.sock\"#\"$run/status.sock\"#" -e "s#\"demo_output/#\"#" \
    config/demo/thermocompd.toml >"$out/thermocompd.toml"
  "$bin/thermocompd" "$out/thermocompd.toml" >"$out/thermocompd.log" 2>&1 &
  daemon_pid=$!
  eventually 20 "thermocompd does not get ready" daemon_answers
}

# Stops a second before the machine's end, after which the daemon could only report faults.
watch_the_shift() {
  local ended=0
  "$bin/thermocomp" --socket "$run/status.sock" watch --truth "$out/truth.csv" --for "$((shift_s - 1))" &
  watch_pid=$!
  wait "$watch_pid" || ended=$?
  watch_pid=''
  ((ended == 0)) || fail "watch failed: $(tail -n 1 "$out/thermocompd.log")"
  eventually 30 "the simulated machine does not end" has_ended "$sim_pid"
  local status=0
  wait "$sim_pid" || status=$?
  sim_pid=''
  ((status == 0)) || fail "the simulated machine failed: $(tail -n 1 "$out/thermocomp-sim.log")"
}

stop_daemon() {
  local status=0
  kill "$daemon_pid"
  wait "$daemon_pid" || status=$?
  daemon_pid=''
  ((status == 0)) || fail "thermocompd ended with status $status: $(tail -n 1 "$out/thermocompd.log")"
}

draw() {
  local format
  for format in png svg; do
    gnuplot -e "truth='$out/truth.csv'; events='$out/events.dat'; format='$format'" \
      -e "picture='$out/demo.$format'" scripts/demo.gnuplot 2>"$out/gnuplot.log" ||
      fail "gnuplot failed: $(tail -n 1 "$out/gnuplot.log")"
  done
  rm -f "$out/gnuplot.log"
}

# One line per event: begin [h], end [h], name.
list_events() {
  awk '
    function emit() { if (inside) printf "%g %g \"%s %s\"\n", at / 3600, (at + lasts) / 3600, kind, target }
    /^\[\[event\]\]/ { emit(); inside = 1; kind = target = ""; at = lasts = 0; next }
    /^\[/ { emit(); inside = 0 }
    !inside { next }
    { split($0, part, /[ \t]*=[ \t]*/); value = part[2]; sub(/[ \t]*#.*/, "", value); gsub(/"/, "", value) }
    part[1] == "kind" { kind = value; gsub(/_/, " ", kind) }
    part[1] == "target" { target = value; gsub(/_/, " ", target) }
    part[1] == "at_s" { at = value }
    part[1] == "duration_s" { lasts = value }
    END { emit() }' config/demo/machine.toml >"$out/events.dat"
}

# The daemon's temperatures on the machine's finite elements, with the clock of the shift.
draw_body() {
  "$bin/thermocomp" export "$out/history.db" -o - 2>"$out/structure.log" |
    awk -F, -v OFS=, -v factor="$time_factor" '/^[0-9]/ { $1 *= factor } { print }' >"$out/shift.csv" ||
    fail "no temperatures in $out/history.db: $(tail -n 1 "$out/structure.log")"
  "$bin/thermocomp" structure config/demo/structure.toml -o "$out/structure_model.toml" \
    --page "$out/body.html" --run "$out/shift.csv" >"$out/structure.log" 2>&1 ||
    fail "the body was not drawn: $(tail -n 1 "$out/structure.log")"
  rm -f "$out"/structure{_model.toml,.log}
  echo "in three dimensions: $out/body.html (for a browser)"
}

if [[ ${1:-} == body ]]; then
  [[ -s $out/history.db ]] || fail "there is no shift yet; first run ./demo.sh"
  stage "packages" scripts/setup.sh modelling
  stage "configure" cmake --preset release
  stage "build" cmake --build --preset release -j "$(build_jobs)" --target thermocomp thermocomp-modelling
  draw_body
  exit
fi

stage "packages" scripts/setup.sh demo
stage "configure" cmake --preset release
stage "build" cmake --build --preset release -j "$(build_jobs)" \
  --target thermocompd thermocomp thermocomp-sim
prepare
echo "== an eight-hour shift in $shift_s s (temperatures as the daemon sees them; error: the truth)"
start_simulated_machine
start_daemon
watch_the_shift
stop_daemon
list_events
draw
echo
echo "picture: $out/demo.png and $out/demo.svg"
# With this source's modelling tools, which the demo does not build.
if [[ ! -x $bin/thermocomp-modelling ]] || ! (draw_body) 2>/dev/null; then
  echo "in three dimensions: ./demo.sh body (builds the modelling tools first)"
fi
echo "history: $out/history.db, truth: $out/truth.csv, logs: $out/*.log"
grep -E '^error rms at the tool: ' "$out/thermocomp-sim.log" | tail -n 1 | grep . ||
  fail "no result in $out/thermocomp-sim.log"
