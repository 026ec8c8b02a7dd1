#!/usr/bin/env bash
# Opens the page of a small render in a browser without a display, and sees that its script has drawn the picture.
#
#   tests/cli/report_page.sh RELIEF CHROMIUM [FOLDER]
#
# With a folder, the page, and screenshots of it in both colour schemes at the width of a laptop and of a 1080p display,
# stay there for people to look at.
set -euo pipefail
relief=$1
chromium=$2
root=$(dirname "${BASH_SOURCE[0]}")/../..
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

browse() {
  "$chromium" --headless=new --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir="$folder/profile" \
    --virtual-time-budget=20000 "$@" 2> "$folder/log" || {
    cat "$folder/log" >&2
    exit 1
  }
}

page=$folder/report.html
options=(--resolution 96x54 --spp 8 --progress none)
[[ $# -lt 3 ]] || options=(--resolution 960x540 --spp 16)
"$relief" render "$root/examples/displaced/displaced.gltf" "${options[@]}" --seed 1 -o "$folder/reference.exr"
"$relief" render "$root/examples/displaced/displaced.gltf" "${options[@]}" --reference "$folder/reference.exr" \
  -o "$folder/frame.exr" --report "$page" > "$folder/log"
browse --dump-dom "file://$page" > "$folder/dom.html"
grep -q "class=\"viewer ready\"" "$folder/dom.html" || {
  echo "report_page: the script of the page did not get to its end" >&2
  exit 1
}
[[ $# -ge 3 ]] || exit 0
mkdir -p "$3"
cp "$page" "$3"
for width in 1366 1920; do
  browse --window-size=$width,4200 --screenshot="$3/light-$width.png" "file://$page"
  browse --force-dark-mode --window-size=$width,4200 --screenshot="$3/dark-$width.png" "file://$page"
done
