#!/usr/bin/env bash
# The inverse on a real card: the conformance suite, the paper's sizes, and the vendor's library.
#
#   bench/gpu_card.sh pack DIR   on a machine that builds: stripped binaries and the Vulkan loader
#   bench/gpu_card.sh run DIR    on the machine with the card, which needs its driver and no compiler
#   bench/gpu_card.sh            both here, in a scratch folder
#
# Fails where the first adapter is a CPU: figures of a software device say nothing about a card.
set -euo pipefail

pack() {
    local out="$1" root binary
    root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
    mkdir -p "$out/bin" "$out/lib"
    cd "$root"
    cargo build --release -p yawara-bench --features gpu
    cargo build --release -p yawara --features gpu
    cp target/release/yawara-bench target/release/yawara "$out/bin/"
    for test in gpu_conformance gpu_accuracy; do
        binary=$(cargo test --release -p yawara-tests --test "$test" --no-run --message-format=json |
            grep -o '"executable":"[^"]*"' | tail -1 | cut -d'"' -f4)
        cp "$binary" "$out/bin/$test"
    done
    strip "$out"/bin/*
    # NVIDIA's Vulkan driver is not loaded without libglvnd's libraries.
    for library in libvulkan.so.1 libEGL.so.1 libGLX.so.0 libGLdispatch.so.0; do
        ldconfig -p | awk -v name="$library" '$1 == name && !seen++ { print $NF }' |
            xargs -r -I{} cp -L {} "$out/lib/$library"
    done
    [ -e "$out/lib/libvulkan.so.1" ] || { echo "no libvulkan.so.1 here to be taken along" >&2; exit 1; }
    cp bench/gpu_vendor.py bench/gpu_card.sh "$out/"
}

run() {
    cd "$1"
    export LD_LIBRARY_PATH="$PWD/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" REQUIRE_GPU=1
    bin/yawara devices | tee devices.txt
    if head -1 devices.txt | grep -q '(cpu, '; then
        echo "the first adapter is a CPU: no card is reached here" >&2
        exit 1
    fi
    bin/gpu_conformance
    bin/gpu_accuracy --include-ignored --nocapture
    bin/yawara-bench table1 --gpu --force --pairs 50 --out table1_gpu
    python3 gpu_vendor.py | tee vendor.md || echo "the vendor's library was not compared" >&2
}

here="${BASH_SOURCE[0]}"
case "${1:-both}" in
pack) pack "$(mkdir -p "$2" && cd "$2" && pwd)" ;;
run) run "$2" ;;
both)
    scratch=$(mktemp -d)
    bash "$here" pack "$scratch"
    bash "$here" run "$scratch"
    ;;
*)
    echo "usage: $here [pack DIR | run DIR]" >&2
    exit 2
    ;;
esac
