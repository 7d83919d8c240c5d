# Sourced by start-px4.sh and start-ardupilot.sh: where vehicles stand, and how they are ended.
# shellcheck shell=sh

# The fleets' [site] origin.
ORIGIN_LAT=-35.363261
ORIGIN_LON=149.165230
# shellcheck disable=SC2034  # for the starters
ORIGIN_ALT=584

SPACING_M=15

# usage LINE...: print the lines and end with exit code 2.
usage() {
    printf '%s\n' "$@" >&2
    exit 2
}

# check_count N: end unless N is between 1 and 10.
check_count() {
    case $1 in
        [1-9] | 10) ;;
        *) usage "how many vehicles, 1 to 10, not '$1'" ;;
    esac
}

# home NUMBER OF NORTH_M: print "LAT LON EAST_M" of the home of vehicle NUMBER (from 0) in a row of OF.
home() {
    awk -v i="$1" -v n="$2" -v north="$3" -v lat="$ORIGIN_LAT" -v lon="$ORIGIN_LON" -v spacing="$SPACING_M" 'BEGIN {
        east = spacing * (i - (n - 1) / 2)
        metre = 180 / (atan2(0, -1) * 6378137)
        printf "%.7f %.7f %g\n", lat + north * metre, lon + east * metre / cos(lat * atan2(0, -1) / 180), east
    }'
}

# make_state_directory: set $state to where vehicles keep parameters and logs.
make_state_directory() {
    if [ -n "${HSOP_SITL_DIR:-}" ]; then
        mkdir -p "$HSOP_SITL_DIR"
        state=$(cd "$HSOP_SITL_DIR" && pwd)
    else
        state=$(mktemp -d)
    fi
}

# return_altitude_m NUMBER: above home, another one for each vehicle.
return_altitude_m() {
    echo $((30 + 5 * $1))
}

# fly_until_interrupted PID...: wait for the vehicles; Ctrl-C, TERM or their own end ends them all.
fly_until_interrupted() {
    pids=$*
    trap end_vehicles EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM
    echo "$# vehicles; Ctrl-C ends them"
    wait
}

end_vehicles() {
    trap - EXIT INT TERM
    # shellcheck disable=SC2086
    kill $pids 2>/dev/null || :
    wait
    if [ -z "${HSOP_SITL_DIR:-}" ]; then
        rm -rf "$state"
    fi
}
