#!/usr/bin/env bash
# The seed's demo in the editor's real window, on a screen that nobody sees, with software OpenGL.
#
# usage: tests/editor/demo.sh PROGRAM FOLDER [short]
#
# Drives PROGRAM (`whitted` built with the feature `editor`) by keys and clicks, leaves a screenshot of each step in FOLDER, and fails if
# the scene that is saved, or the picture of it, is not as it should be. `short` opens, selects, renders and closes.
set -euo pipefail
program=$(realpath "${1:?usage: tests/editor/demo.sh PROGRAM FOLDER [short]}")
mkdir -p "${2:?usage: tests/editor/demo.sh PROGRAM FOLDER [short]}"
folder=$(realpath "$2")
short=${3:-}
root=$(cd "$(dirname "$0")/../.." && pwd)

need() { command -v "$1" >/dev/null || missing="${missing:-} $2"; }
need Xvfb xvfb
need xdotool xdotool
need import imagemagick
[ -n "$(ls /usr/lib/*/dri/*swrast*_dri.so /usr/lib/*/libgallium*.so 2>/dev/null)" ] || missing="${missing:-} libgl1-mesa-dri"
[ -n "$(ls /usr/lib/*/libEGL.so.1 2>/dev/null)" ] || missing="${missing:-} libegl1 libgl1"
for library in libX11.so.6:libx11-6 libXcursor.so.1:libxcursor1 libXi.so.6:libxi6 libXrandr.so.2:libxrandr2 \
    libxkbcommon-x11.so.0:libxkbcommon-x11-0; do
    [ -n "$(ls /usr/lib/*/"${library%%:*}" 2>/dev/null)" ] || missing="${missing:-} ${library##*:}"
done
if [ -n "${missing:-}" ]; then
    apt-get update -q
    # shellcheck disable=SC2086
    apt-get install -q -y --no-install-recommends $missing
fi

rm -f "$folder"/*.png "$folder"/*.toml "$folder"/*.err
export XDG_DATA_HOME="$folder/data" LIBGL_ALWAYS_SOFTWARE=1 WINIT_X11_SCALE_FACTOR=1
rm -rf "$XDG_DATA_HOME"
unset WAYLAND_DISPLAY
exec 9< <(exec Xvfb -noreset -displayfd 1 -screen 0 1280x800x24 2>/dev/null)
server=$!
read -r -u 9 number
export DISPLAY=":$number"
editor=
trap 'kill $editor $server 2>/dev/null || true' EXIT

start() {
    "$program" edit "$@" 2>"$folder/editor.err" &
    editor=$!
    for _ in $(seq 300); do
        window=$(xdotool search --pid $editor 2>/dev/null | tail -1 || true)
        [ -n "$window" ] && xdotool getwindowname "$window" 2>/dev/null | grep -q whitted && break
        kill -0 $editor || { cat "$folder/editor.err"; exit 1; }
        sleep 0.1
    done
    xdotool windowmove "$window" 0 0 windowsize "$window" 1280 800
    sleep 1
    for _ in $(seq 20); do xdotool windowfocus "$window" 2>/dev/null && break; sleep 0.2; done
    sleep 0.5
}
key() { for k in "$@"; do xdotool key "$k"; sleep 0.25; done; }
click() { xdotool mousemove "$1" "$2"; sleep 0.15; xdotool click 1; sleep 0.35; }
drag() {
    xdotool mousemove "$1" "$2"; sleep 0.1; xdotool mousedown 1
    for step in 1 2 3 4 5 6 7 8; do
        xdotool mousemove $(($1 + ($3 - $1) * step / 8)) $(($2 + ($4 - $2) * step / 8)); sleep 0.06
    done
    xdotool mouseup 1; sleep 0.4
}
type_path() { sleep 0.4; key ctrl+a; xdotool type --delay 8 "$1"; sleep 0.3; key Return; sleep 0.8; }
shot() { import -window root "$folder/$1.png"; }
title() { xdotool getwindowname "$window"; }
# While a picture is rendered the window's title says what part of it is.
finish() {
    sleep 0.8
    for _ in $(seq 600); do title | grep -q % || return 0; sleep 0.2; done
    echo 'the picture is not finished'; exit 1
}
save_picture() {
    finish
    key ctrl+p
    type_path "$1"
    [ -s "$1" ] || { shot not-saved; echo "no picture was saved as $1"; exit 1; }
}
expect() { grep -q -- "$1" "$2" || { echo "$2 has no \`$1\`:"; cat "$2"; exit 1; }; }

if [ "$short" = short ]; then
    start "$root/scenes/mirrors.toml"
    click 600 430
    shot short-1-selected
    key F5
    save_picture "$folder/short.png.tmp.png"
    shot short-2-rendered
    "$program" render --quiet "$root/scenes/mirrors.toml" -o "$folder/expected.tmp.png"
    cmp "$folder/short.png.tmp.png" "$folder/expected.tmp.png"
    key ctrl+q
    for _ in $(seq 50); do kill -0 $editor 2>/dev/null || break; sleep 0.1; done
    ! kill -0 $editor 2>/dev/null || { echo 'the editor did not close'; exit 1; }
    wait $editor
    echo 'the short demo passed'
    exit 0
fi
scene="$folder/demo.toml"
start
shot 01-start
# Menus are found by where they are in a window of 1280 x 800: Add, and its first and twelfth lines.
click 88 12; shot 02-add; click 104 39; shot 03-sphere
# Presets are buttons beside each other under the material: gold.
click 1183 268; shot 04-gold
key w; drag 585 404 585 360; shot 05-moved
click 88 12; click 114 324; shot 06-light
# The light's colour: the button, and a place in the field of colours that it opens.
click 1070 86; shot 07-colour-picker
click 1000 200; key Escape; shot 08-colour
# The sphere again, and an image for it.
click 70 108; key t; type_path "$root/meshes/checker.png"; shot 09-texture
key Left Left; shot 10-turned
key F5; sleep 1; shot 11-rendering
save_picture "$folder/full.tmp.png"; shot 12-rendered
key ctrl+s; type_path "$scene"; shot 13-saved
"$program" render --quiet "$scene" -o "$folder/expected.tmp.png"
cmp "$folder/full.tmp.png" "$folder/expected.tmp.png"
expect 'name = "gold"' "$scene"
expect 'kind = "point"' "$scene"
expect 'checker.png' "$scene"
[ "$(grep -c '^\[\[light\]\]' "$scene")" = 2 ] || { echo 'no second light'; exit 1; }
! grep -q 'color = \[0.6, 0.6, 0.6\]' "$scene" || { echo 'the light has the colour it began with'; exit 1; }
# A region of the picture, dragged.
key F7 F6; drag 450 330 700 500; sleep 2
save_picture "$folder/region.tmp.png"; shot 14-region
python3 - "$folder/region.tmp.png" "$folder/full.tmp.png" <<'PYTHON' || { echo 'the region is no part of the picture'; exit 1; }
import struct, sys
def size(name):
    data = open(name, 'rb').read(24)
    return struct.unpack('>II', data[16:24])
region, full = size(sys.argv[1]), size(sys.argv[2])
sys.exit(not (0 < region[0] < full[0] and 0 < region[1] < full[1]))
PYTHON
# Why a pixel has its colour.
key F7 F5; sleep 0.5; save_picture "$folder/again.tmp.png"
cmp "$folder/again.tmp.png" "$folder/full.tmp.png"
key F8; click 585 430; sleep 1; shot 15-explained; key Escape
key F7 ctrl+z; shot 16-undone; key ctrl+shift+z
key ctrl+q
for _ in $(seq 50); do kill -0 $editor 2>/dev/null || break; sleep 0.1; done
! kill -0 $editor 2>/dev/null || { shot not-closed; echo 'the editor did not close'; exit 1; }
wait $editor
start "$scene"
shot 17-reopened
key F5; save_picture "$folder/reopened.tmp.png"
cmp "$folder/reopened.tmp.png" "$folder/expected.tmp.png"
# A change that is not saved: closing asks.
key ctrl+a Delete ctrl+q; sleep 0.5; shot 18-asked
kill -0 $editor
# A crash: what was not saved is offered again.
sleep 6
kill -9 $editor
wait $editor 2>/dev/null || true
start "$scene"
shot 19-recovery
echo 'the demo passed'
