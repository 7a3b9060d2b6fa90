#!/bin/sh
# Makes model/weights/live.safetensors anew: `training/recipe/live.sh MOTION_DIR OUT`, a program
# built with `--features train` in SERVODANCE. Two and a half hours on two cores; a run that was stopped
# goes on where it stopped.
set -eu
motion=$1 out=$2 recipe=$(dirname "$0") program=${SERVODANCE:-target/release/servodance}
mkdir -p "$out"
cp "$recipe"/*.toml "$out"

build() { # NAME OPTIONS...
    file=$out/$1.safetensors
    shift
    [ -f "$file" ] || "$program" dataset build "$file" --motion "$motion" --seed 1 "$@"
}

train() { # NETWORK NAME
    resume=
    [ ! -f "$out/$2/$1/last.safetensors" ] || resume=--resume
    "$program" train "$1" --config "$out/$2.toml" $resume
}

build codes --songs 4 --figures 200 --choreography 36
build dance --songs 10 --figures 400 --choreography 60
train vqvae codes
train motionseq dance
train vqvae decoder
"$program" weights join "$out/dance/motionseq/weights.safetensors" \
    --stage-one "$out/decoder/vqvae/weights.safetensors" --out "$out/joined.safetensors"
"$program" weights convert "$out/joined.safetensors" --dtype f16 --out "$out/live.safetensors"
