#!/bin/sh
# Start N PX4 vehicles on this machine, for sitl_configs/px4/fleet-N.toml; Ctrl-C ends them.
#
#   HSOP_PX4_BIN=.../build/px4_sitl_default/bin/px4 sitl_configs/start-px4.sh 4
#   HSOP_PX4_IMAGE=px4io/px4-sitl:v1.17.0 sitl_configs/start-px4.sh 4
#   sitl_configs/start-px4.sh --env     the parameters as environment variables, for docker's --env-file
#
# PX4_SIM_MODEL  sihsim_quadx (the default, nothing else needed) or gz_x500_gimbal (Gazebo)
# HSOP_PX4_ETC   PX4's etc folder, if it is not ../etc as seen from the binary
# HSOP_SITL_DIR  where parameters and logs stay; without it in a temporary folder, removed at the end
#
# Vehicle i of N (from 0) is system i + 1 and sends to UDP port 14540 + i of 127.0.0.1.
set -eu
configs=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
# shellcheck source=sitl_configs/vehicles.sh
. "$configs/vehicles.sh"

model=${PX4_SIM_MODEL:-sihsim_quadx}
case $model in
    sihsim_*) gimbal="gimbal-sih.params" ;;
    gz_*) gimbal="gimbal-gz.params" ;;
    *) usage "PX4_SIM_MODEL is sihsim_quadx or gz_x500_gimbal, not '$model'" ;;
esac

# parameters: one NAME=VALUE per line, as PX4's start script takes them from the environment.
parameters() {
    echo "PX4_SIM_MODEL=$model"
    for file in failsafe.params fence.params "$gimbal" sitl.params; do
        awk -F '\t' '!/^#/ && NF == 5 { printf "PX4_PARAM_%s=%s\n", $3, $4 }' "$configs/px4/$file"
    done
}

if [ "${1:-}" = --env ]; then
    parameters
    exit
fi
count=${1:-}
check_count "$count"
if [ -n "${HSOP_PX4_BIN:-}" ]; then
    [ -x "$HSOP_PX4_BIN" ] || usage "HSOP_PX4_BIN: no program at '$HSOP_PX4_BIN'"
    binary=$(readlink -f "$HSOP_PX4_BIN")
    etc=${HSOP_PX4_ETC:-$(dirname "$binary")/../etc}
    [ -f "$etc/init.d-posix/rcS" ] || usage "no init.d-posix/rcS in '$etc': set HSOP_PX4_ETC to PX4's etc folder"
    etc=$(cd "$etc" && pwd)
elif [ -z "${HSOP_PX4_IMAGE:-}" ]; then
    usage "set HSOP_PX4_BIN to a px4 binary or HSOP_PX4_IMAGE to a container image"
fi

make_state_directory
pids=
i=0
while [ "$i" -lt "$count" ]; do
    # shellcheck disable=SC2046
    set -- $(home "$i" "$count" 0)
    lat=$1 lon=$2 east=$3
    # shellcheck disable=SC2046
    set -- $(parameters) "PX4_PARAM_RTL_RETURN_ALT=$(return_altitude_m "$i")" "PX4_HOME_ALT=$ORIGIN_ALT"
    case $model in
        sihsim_*) set -- "$@" "PX4_HOME_LAT=$lat" "PX4_HOME_LON=$lon" ;;
        *)  # one world with one origin, made by the first vehicle; the others stand beside it
            set -- "$@" "PX4_HOME_LAT=$ORIGIN_LAT" "PX4_HOME_LON=$ORIGIN_LON" "PX4_GZ_MODEL_POSE=$east,0" "HEADLESS=${HEADLESS-1}"
            [ "$i" -eq 0 ] || set -- "$@" PX4_GZ_STANDALONE=1
            ;;
    esac
    mkdir -p "$state/px4-$i"
    if [ -n "${HSOP_PX4_BIN:-}" ]; then
        env "$@" "$binary" -d -i "$i" -w "$state/px4-$i" "$etc" >"$state/px4-$i/out.txt" 2>&1 &
    else
        printf '%s\n' "$@" >"$state/px4-$i/env"
        docker run --rm --network host --env-file "$state/px4-$i/env" "$HSOP_PX4_IMAGE" -d -i "$i" \
            >"$state/px4-$i/out.txt" 2>&1 &
    fi
    pids="$pids $!"
    echo "system $((i + 1)): home $lat,$lon -> 127.0.0.1:$((14540 + i)), output in $state/px4-$i/out.txt"
    i=$((i + 1))
done
# shellcheck disable=SC2086
fly_until_interrupted $pids
