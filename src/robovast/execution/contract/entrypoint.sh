#!/usr/bin/env bash
# Runs one job: the scenario of SCENARIO_FILE, once per document of SCENARIO_PARAMETER_FILE.
#
# Needs only bash, coreutils and python3 of the image, whoever made it. Leaves in OUTPUT_DIR:
# sysinfo.yaml, resource_usage_main.csv, logs/system.log. While it lives, it holds an exclusive
# lock on $ROBOVAST_OUT_DIR/.running, which the kernel releases however it ends.
#
# Exit code: that of scenario-execution, or
#   69  the image lacks something, which the message names
#   70  the pre command failed, or the post command cannot be run
#   73  an output folder is not writable, or belongs to a job that still runs
#
# Pre command and run find the variables of image and document: those of ours that would hide one
# begin with _.

_contract=${BASH_SOURCE[0]%/*}
_config=${ROBOVAST_CONFIG_DIR:-/config}
_out=${ROBOVAST_OUT_DIR:-/out}
_logs=${OUTPUT_DIR:?}/logs

say() { printf '[robovast] %s\n' "$*"; }

fail() { # CODE MESSAGE...
    say "error: ${*:2}"
    exit "$1"
}

# tee ignores the signals that end the job, to hear its last words.
log_to() { # FILE
    check_output "$_logs"
    exec 3>&1
    coproc _log { trap '' INT TERM; exec tee -a "$1" 4>&1 >&3 3>&-; }
    _log_pid=$! _log_ended=${_log[0]}
    exec >&"${_log[1]}" 2>&1 3>&-
    eval "exec ${_log[1]}>&-"
    trap close_log EXIT
}

# The log is complete when tee ends. A daemon that holds our end of the pipe must not delay that: then it
# is, when the pipe is empty and tee sleeps, however long a busy machine takes until then.
close_log() {
    exec >&- 2>&-
    read -rt 1 -u "$_log_ended"
    (($? <= 128)) && return
    python3 -I -S -c '
import array, fcntl, os, sys, termios, time
tee, until = "/proc/" + sys.argv[1], time.monotonic() + 60
pipe, left = os.open(tee + "/fd/0", os.O_RDONLY | os.O_NONBLOCK), array.array("i", [1])
def sleeps():
    with open(tee + "/stat") as stat:
        return stat.read().rpartition(")")[2].split()[0] == "S"
while (left[0] or not sleeps()) and time.monotonic() < until:
    time.sleep(0.05)
    fcntl.ioctl(pipe, termios.FIONREAD, left)' "$_log_pid"
    kill -KILL "$_log_pid"
}

check_tools() {
    local tool tools=(python3 stdbuf tee find) missing=()
    wants_x11 && tools+=(Xvfb start-stop-daemon)
    for tool in "${tools[@]}"; do
        type -P "$tool" >/dev/null || missing+=("$tool")
    done
    [[ ${#missing[@]} == 0 ]] || fail 69 "the image lacks: ${missing[*]} (looked on PATH $PATH;" \
        "with ENABLE_X11=false, Xvfb and start-stop-daemon are not needed)"
}

check_output() { # FOLDER...
    local folder
    mkdir -p "$@" 2>/dev/null
    for folder; do
        [[ -d $folder && -w $folder ]] || fail 73 "user $EUID cannot write the output folder $folder"
    done
}

# Descriptor 9 is closed for every child: a daemon that survives the job must not hold the lock.
hold_lock() {
    exec 9>>"$_out/.running" || fail 73 "cannot write $_out/.running"
    flock -n 9 2>/dev/null || python3 -I -S -c '
import fcntl, time
for _ in range(50):
    try:
        raise SystemExit(fcntl.flock(9, fcntl.LOCK_EX | fcntl.LOCK_NB))
    except OSError:
        time.sleep(0.1)
raise SystemExit(1)' || fail 73 "another job runs in $_out (it holds the lock $_out/.running)"
    echo >&9 # who looks too seldom to see the lock held sees that it was
}

match_user_to_uid() {
    ((EUID == 0)) || ! type -P fixuid >/dev/null || eval "$(fixuid -q)"
}

source_ros() {
    local setup
    for setup in "/opt/ros/$ROS_DISTRO/setup.bash" /ws/install/setup.bash; do
        # shellcheck disable=SC1090
        [[ -f $setup ]] && source "$setup"
    done
}

# Where a pre or post command is: its path is written as seen in a container, under /config.
command_path() { # PATH
    case $1 in
    /config/*) echo "$_config/${1#/config/}" ;;
    /*) echo "$1" ;;
    *) echo "$_config/$1" ;;
    esac
}

# Sets _executor and _with_ros; it is the program that `ros2 run scenario_execution_ros scenario_execution_ros`
# would start, without the second that the ros2 command takes to find it, and to forward signals.
find_executor() {
    local prefix IFS=:
    for prefix in $AMENT_PREFIX_PATH; do
        _executor=$prefix/lib/scenario_execution_ros/scenario_execution_ros
        [[ -x $_executor ]] && _with_ros=1 && return
    done
    _executor=$(type -P scenario_execution) || fail 69 "the image has no scenario-execution:" \
        "neither the ROS package scenario_execution_ros in /opt/ros/\$ROS_DISTRO or /ws/install," \
        "nor the command scenario_execution on PATH $PATH"
}

# Sets _command.
scenario_command() {
    local post extra
    _command=("$_executor" -o "$SCENARIO_OUTPUT_DIR" "$_config/${SCENARIO_FILE:?}")
    if [[ $POST_COMMAND ]]; then
        post=$(command_path "$POST_COMMAND")
        [[ -f $post && -x $post ]] || fail 70 "the post command $post is not an executable file"
        _command+=(--post-run "$post")
    fi
    [[ $SCENARIO_PARAMETER_FILE ]] &&
        _command+=(--scenario-parameter-file "$_config/$SCENARIO_PARAMETER_FILE")
    [[ $SIMULATION ]] && _command+=(--simulation "$SIMULATION")
    if [[ $OUTPUT_RESULT_PER_SCENARIO == true ]]; then
        _command+=(--output-result-per-scenario)
        use_driver
    fi
    read -ra extra <<<"$SCENARIO_EXECUTION_PARAMETERS"
    _command=(stdbuf -oL -eL "${_command[@]}" "${extra[@]}")
}

# scenario-execution writes verdicts only when the last scenario has ended; the driver writes each
# at once. It runs inside the interpreter of the executor, which its first lines name.
use_driver() {
    local first second interpreter
    { read -r first && read -r second; } <"$_executor"
    if [[ $first == '#!'*python* ]]; then
        read -ra interpreter <<<"${first#??}"
    elif [[ $second == "'''exec'"* ]]; then # how installers write a path that is long or has spaces
        interpreter=("${_executor%/*}/python3")
    else
        say "warning: $_executor is no Python program; verdicts appear when the whole pack has ended," \
            "and of several runs none gets its ROBOVAST_SEED"
        return
    fi
    _command=("${interpreter[@]}" "$_contract/run_scenarios.py" "${_command[@]}")
}

wants_x11() { [[ ! ${ENABLE_X11,,} =~ ^(false|no|off|0)$ ]]; }

# A display that has a host, or a socket, is somebody else's.
start_x() {
    local number=${DISPLAY##*:} ready
    wants_x11 && ! [[ $DISPLAY == [!:]* || -S /tmp/.X11-unix/X${number%%.*} ]] || return 0
    # shellcheck disable=SC2086  # no DISPLAY means no argument: Xvfb then takes a free number
    exec {ready}< <(exec Xvfb $DISPLAY -displayfd 1 -screen 0 1920x1080x24 -nolisten tcp 2>"$_logs/xvfb.log")
    read -rt 30 number <&"$ready" || fail 69 "Xvfb did not start, see $_logs/xvfb.log"
    export DISPLAY=:$number
    exec {ready}<&-
}

# Without a namespace, only the descendants of this script belong to the job.
start_monitor() { # NAME [OPTION...]
    local root=()
    [[ $_config == /config ]] || root=(--root-pid $$)
    python3 -I -S "$_contract/monitor_resources.py" "$OUTPUT_DIR/resource_usage_$1.csv" "${root[@]}" "${@:2}" &
    _monitor_pid=$!
}

# A job can be over before Python has started; and a run can have taken the file away.
await_sysinfo() {
    local tries=0
    until [[ -e $_sysinfo_file ]] || ((++tries > 500)) || ! kill -0 "$_monitor_pid"; do sleep 0.01; done
} 2>/dev/null

source_pre_command() {
    [[ $PRE_COMMAND ]] || return 0
    local _pre code
    _pre=$(command_path "$PRE_COMMAND")
    [[ -f $_pre ]] || fail 70 "the pre command $_pre does not exist"
    _in_pre_command=1 # tells an `exit` of its own from ours
    # shellcheck disable=SC1090
    source "$_pre"
    code=$?
    _in_pre_command=
    set +eu
    ((code == 0)) || fail 70 "the pre command $_pre failed with code $code"
}

# An asynchronous command ignores SIGINT, the one signal on which every ros2 bag closes its file.
record_rosout() {
    [[ $_with_ros ]] || return 0
    env --default-signal=INT ros2 bag record -s mcap -o "$OUTPUT_DIR/logs/rosout_bag" /rosout \
        >"$OUTPUT_DIR/logs/rosout_bag.log" 2>&1 &
    _recorder_pid=$!
}

# Runs a command, hands it the request to stop, and returns its code.
supervise() { # COMMAND...
    local _child='' code _signalled=''
    trap '_signalled=1; [[ ! $_child ]] || kill -TERM $_child' TERM INT
    "$@" 9>&- &
    _child=$!
    [[ $_signalled ]] && kill -TERM "$_child"
    while wait "$_child"; code=$?; [[ $_signalled ]]; do _signalled=''; done
    return "$code"
}

# Also what a pre command left in the background.
stop_descendants() { # PID
    local child children
    read -ra children <"/proc/$1/task/$1/children"
    for child in "${children[@]}"; do
        stop_descendants "$child"
        kill "$child"
    done
} 2>/dev/null

# The kernel's list of children may leave one out while another ends, so that the monitor is told by
# its number, and all others are looked for once more.
stop_all() { # PID
    stop_descendants "$1"
    kill "$_monitor_pid" 2>/dev/null
    wait "$_monitor_pid"
    stop_descendants "$1"
}

end_job() { # CODE
    local code=$1
    set +eu # a pre command that ended the shell may have left them on
    if [[ $_recorder_pid ]]; then
        kill -INT "$_recorder_pid"
        { sleep 10; kill -KILL "$_recorder_pid"; } &
        wait "$_recorder_pid"
    fi
    await_sysinfo
    stop_all "$BASHPID"
    [[ ! $_in_pre_command ]] || ((code > 128)) || fail 70 "the pre command left the shell with $code"
    exit "$code"
}

# The pre command shares this shell, and may take whatever name it likes for its variables: what
# follows it is in the arguments, in the environment, or has a name that it will not take.
job() { # COMMAND...
    _sysinfo_file=$OUTPUT_DIR/sysinfo.yaml _monitor_pid='' _recorder_pid='' _in_pre_command=''
    trap 'end_job $?' EXIT
    start_monitor main --sysinfo "$_sysinfo_file"
    start_x
    source_pre_command
    trap 'end_job $?' EXIT
    record_rosout
    supervise "$@"
}

main() {
    log_to "$_logs/system.log"
    check_tools
    check_output "$_out" "${SCENARIO_OUTPUT_DIR:?}"
    hold_lock
    match_user_to_uid
    source_ros
    find_executor
    scenario_command
    export PYTHONUNBUFFERED=1 # what a program said before it was killed is in the log
    say "job $OUTPUT_DIR: ${_command[*]@Q}"
    supervise job "${_command[@]}"
    local code=$?
    say "ended with code $code"
    exit "$code"
}

[[ ${BASH_SOURCE[0]} != "$0" ]] || main
