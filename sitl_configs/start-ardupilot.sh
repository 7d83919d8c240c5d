#!/bin/sh
# Start N ArduCopter vehicles on this machine, for sitl_configs/ardupilot/fleet-N.toml; Ctrl-C ends them.
#
#   HSOP_ARDUCOPTER_BIN=.../build/sitl/bin/arducopter sitl_configs/start-ardupilot.sh 4
#   HSOP_ARDUPILOT_IMAGE=my-ardupilot:4.6 sitl_configs/start-ardupilot.sh 4     (arducopter on the image's PATH)
#
# HSOP_SITL_DIR  where parameters and logs stay; without it in a temporary folder, removed at the end
#
# Vehicle i of N (from 0) is system i + 11 and sends to UDP port 14560 + i of 127.0.0.1 (SERIAL1); all send to 14550
# as well (SERIAL0), for another ground station to look on. PX4 vehicles of start-px4.sh can fly beside them.
set -eu
configs=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
# shellcheck source=sitl_configs/vehicles.sh
. "$configs/vehicles.sh"

count=${1:-}
check_count "$count"
if [ -n "${HSOP_ARDUCOPTER_BIN:-}" ]; then
    [ -x "$HSOP_ARDUCOPTER_BIN" ] || usage "HSOP_ARDUCOPTER_BIN: no program at '$HSOP_ARDUCOPTER_BIN'"
    binary=$(readlink -f "$HSOP_ARDUCOPTER_BIN")
elif [ -z "${HSOP_ARDUPILOT_IMAGE:-}" ]; then
    usage "set HSOP_ARDUCOPTER_BIN to an arducopter binary or HSOP_ARDUPILOT_IMAGE to a container image"
fi

make_state_directory
pids=
i=0
while [ "$i" -lt "$count" ]; do
    # shellcheck disable=SC2046
    set -- $(home "$i" "$count" -20)
    lat=$1 lon=$2
    own=$state/ardupilot-$i
    mkdir -p "$own"
    altitude_m=$(return_altitude_m "$i")
    printf '# Each vehicle returns at an altitude of its own.\nRTL_ALT %d\nRTL_ALT_M %d\n' \
        "$((100 * altitude_m))" "$altitude_m" >"$own/own.parm"
    defaults=
    for file in sitl link failsafe fence gimbal; do
        cp "$configs/ardupilot/$file.parm" "$own/"
        defaults=$defaults$file.parm,
    done
    set -- --model + --speedup 1 --home "$lat,$lon,$ORIGIN_ALT,0" --defaults "${defaults}own.parm" \
        --instance "$i" --sysid "$((i + 11))" \
        --serial0 udpclient:127.0.0.1:14550 --serial1 "udpclient:127.0.0.1:$((14560 + i))"
    if [ -n "${HSOP_ARDUCOPTER_BIN:-}" ]; then
        (cd "$own" && exec "$binary" "$@") >"$own/out.txt" 2>&1 &
    else
        docker run --rm --network host --volume "$own:/sitl" --workdir /sitl --entrypoint arducopter \
            "$HSOP_ARDUPILOT_IMAGE" "$@" >"$own/out.txt" 2>&1 &
    fi
    pids="$pids $!"
    echo "system $((i + 11)): home $lat,$lon -> 127.0.0.1:$((14560 + i)), output in $own/out.txt"
    i=$((i + 1))
done
# shellcheck disable=SC2086
fly_until_interrupted $pids
