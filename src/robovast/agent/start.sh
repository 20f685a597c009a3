#!/usr/bin/env bash
# In a container of a run's pod: runs the jobs that the agent orders, one after the other. With an
# argument it is the secondary container of that name. Needs what entrypoint.sh needs.
#
# The agent orders by the files order (`run N`, `stop N`, `end`) beside this script, writes the time
# into heartbeat while it lives [s after the machine], and reads the answers in $ROBOVAST_OUT_DIR/.job:
#   lock             held while the main container lives
#   held             the lock was taken
#   N.started.UPTIME job N has begun, so long after the machine [s]
#   N.oom            the kernel has killed processes of job N for lack of memory
#   N.code.CODE      it has ended with this exit code
#   N.over.NAME      it has ended in the secondary container NAME
#   terminated       somebody else told the main container to end, or the agent was silent
# Answers are empty files, which a full disk still takes.
#
# With ROBOVAST_KEEP_PROCESSES, what is left when a job ends is not killed: somebody may have come in to look.
#
# Exit code: 0. How a job ended is the agent's to tell.

unset CONTAINER_NAME # by it a pre command tells where it is
image=$(export -p) # what a run is to find, whatever we call our variables

name=$1
here=${BASH_SOURCE[0]%/*} # the folder of orders, among the inputs
silence=120 # how long the agent may be silent [s]
again=6     # when to look once more: if the machine slept, the agent has still to write [s]
grace=10    # how long a job may take to end when it is told to [s]

word='' number='' job=0 child='' last='' heard=0 terminated='' held=''

read_order() { read -r word number <"$here/order"; }

# As sleep does, which would be a process each time: nobody writes into this pipe.
pause() { # SECONDS
    read -rt "$1" -u 7
    (($? > 128)) || sleep "$1"
} 2>/dev/null

# Sets uptime [s]; $SECONDS would follow a clock that is set.
read_uptime() {
    read -r uptime _ </proc/uptime
    uptime=${uptime%%.*}
}

# Sets kills: how many processes the kernel has killed in this container for lack of memory.
read_kills() {
    local events key value
    kills=0
    for events in memory.events memory/memory.oom_control; do # control groups of version 2, and 1
        while read -r key value; do
            [[ $key == oom_kill ]] && kills=$value
        done <"/sys/fs/cgroup/$events"
    done
} 2>/dev/null

# Some containers have an uptime of their own, so that the agent's is nothing to compare with.
is_fresh() {
    local beat='' uptime
    read -r beat <"$here/heartbeat"
    read_uptime
    [[ $beat == "$last" ]] || { last=$beat heard=$uptime; }
    ((uptime - heard < silence))
}

agent_lives() { is_fresh || { pause "$again"; is_fresh; }; }

# Sets job; false when there is no other.
await_job() {
    while [[ ! $terminated ]]; do
        read_order
        [[ $word == end ]] && return 1
        [[ $word == run ]] && ((number > job)) && job=$number && return
        agent_lives || return 1
        pause 0.1
    done
    return 1
}

# Descriptors 7 and 8 are closed for every child: only this shell holds the lock.
hold_lock() {
    exec 8>>"$answers/lock" &&
        { flock 8 || python3 -I -S -c 'import fcntl; fcntl.flock(8, fcntl.LOCK_EX)'; } 2>/dev/null &&
        answer held && held=1
}

answer() { # WHAT
    : >"$answers/$1"
}

enter_job() {
    exec 7>&- 8>&-
    set -- "$here" "$name" # image and job may have variables of these names
    eval "$image" 2>/dev/null
    # shellcheck source=/dev/null
    source "$1/environment.sh"
    cd "$ROBOVAST_OUT_DIR" || exit
    [[ $2 ]] || exec bash "${1%/*}/entrypoint.sh"
    export CONTAINER_NAME=$2 ROS_LOG_DIR=$OUTPUT_DIR/logs/$2
    exec bash "${1%/*}/secondary_entrypoint.sh"
}

# Ends the job when that is ordered, or when nobody is there to store it: as if somebody had told the
# container to end, so that an agent that goes on does not take it for the run's own end.
watch_orders() {
    local told=$child
    exec 8>&-
    while pause 0.5 && read_order && [[ $word == run ]] && ((number == job)); do
        agent_lives || { told=$$; break; }
    done
    kill -TERM "$told"
    sleep "$grace"
    kill -KILL -- "-$child"
}

run_job() {
    local watcher code uptime kills before
    read_kills
    before=$kills
    [[ $held ]] && { read -r uptime _ </proc/uptime; answer "$job.started.$uptime"; }
    set -m # a process group of its own for the job
    enter_job &
    child=$!
    set +m
    [[ $terminated ]] && kill -TERM "$child"
    watch_orders &
    watcher=$!
    while wait "$child"; code=$?; ((code > 128)) && kill -0 "$child" 2>/dev/null; do :; done
    child=''
    kill "$watcher" 2>/dev/null
    # In a container that is all that the job left behind; elsewhere it is not ours.
    (($$ == 1)) && [[ ! $ROBOVAST_KEEP_PROCESSES ]] && kill -KILL -- -1
    wait "$watcher" 2>/dev/null
    read_kills
    [[ $name ]] || ((kills == before)) || answer "$job.oom"
    if [[ $name ]]; then answer "$job.over.$name"; else answer "$job.code.$code"; fi
}

# shellcheck disable=SC2317  # called by a trap
terminate() {
    terminated=1
    [[ $name ]] || answer terminated
    [[ ! $child ]] || kill -TERM "$child"
}

main() {
    local answers uptime
    trap terminate TERM INT
    exec 7<> <(:)
    read_uptime
    heard=$uptime
    read_order
    [[ $word == end ]] && exit
    # shellcheck source=/dev/null
    answers=$(source "$here/environment.sh" && printf '%s/.job' "$ROBOVAST_OUT_DIR")
    [[ $name ]] || hold_lock
    while await_job; do run_job; done
}

main
exit 0
