#!/usr/bin/env bash
# On a farm: one frame in parts, each a process that any machine may run, and their merge: the bits of one render. Files go to $OUT.
set -euo pipefail
cd "$(dirname "$0")"
out=${OUT:-out}
mkdir -p "$out"
options=(--res 160 0 --seed 7)

# What the farm starts, in any order and anywhere; here beside each other.
parts=()
for range in 0:16 16:32; do
  primray render shot.usda "${options[@]}" --sample-range "$range" --checkpoint "$out/part-${range%:*}.prc" -o "$out/part.${range%:*}.exr" &
  parts+=("$out/part-${range%:*}.prc")
done
wait

primray merge "${parts[@]}" -o "$out/whole.exr" -o "$out/whole.png"
