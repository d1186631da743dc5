#!/usr/bin/env bash
# Makes default_vocabulary.voc: renders two dozen seafloors, easy to hard, and trains on what the left
# and the wrist camera see. usage: make_default_vocabulary.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
[[ $# -eq 1 ]] || { echo "usage: $0 FOLDER_OF_THE_PROGRAMS" >&2; exit 2; }
bin=$(readlink -f "$1")
output=$(dirname "$(readlink -f "$0")")/default_vocabulary.voc
images=$(mktemp -d)
trap 'rm -rf "$images"' EXIT

presets=(easy normal hard)
for seed in {1..24}; do
  "$bin/scene_renderer" --preset "${presets[seed % 3]}" --sequence set --seed "$seed" --frames 3 \
    --quiet "$images/$seed"
done
"$bin/vocabulary_trainer" "$images"/*/hybrid/set/images/raw/*_{left,fish}.jpg \
  --branching 10 --levels 4 --compress --output "$output"
