#!/usr/bin/env bash
# From a shell: a picture, how wrong it is, what else is in the stage, and whether a change of it shows. Files go to $OUT.
set -euo pipefail
cd "$(dirname "$0")"
out=${OUT:-out}
mkdir -p "$out"

primray inspect shot.usda
primray render shot.usda -o "$out/shot.exr" -o "$out/shot.png" --res 240 0 --spp 16 --report "$out/shot.json"
python3 -c 'import json, sys; e = json.load(open(sys.argv[1]))["error"]["relmse"]; print("relMSE", e["estimate"])' "$out/shot.json"

# The same again until its error is small enough, with outputs beside the picture.
primray render shot.usda -o "$out/good.exr" --res 240 0 --target-error 0.02 --time-limit 60 --aov depth,normal,prim

# Has it changed beyond its noise? 0: no, 1: yes, 6: more samples would tell.
primray compare "$out/shot.exr" "$out/good.exr" --tolerance 0.3
