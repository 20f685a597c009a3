#!/usr/bin/env bash
# In a container of a run's pod: waits until the agent has put $0, start.sh, in place, and becomes it
# with the same arguments. The pod has this text itself, as `bash -p -c`: its volume is still empty. It
# must have no two dollars in a row, which Kubernetes would make one.
#
# It ends with 0 instead when it is told to end, when the agent orders `end` in the file order beside
# $0 or is silent in the file heartbeat, or when no agent comes. The main container, which has no
# argument, then leaves the answer `terminated`: an agent that comes later leaves the runs to another
# pod.

image=$(export -p) # what the run is to find, whatever we call our variables

here=${0%/*}
answers=${here%/*/*}/out/.job
silence=120  # how long the agent may be silent [s]
again=6      # when to look once more, as in start.sh [s]
patience=600 # how long it may take to come: its image may have to be pulled [s]

name=$1 word='' beat='' last='' uptime='' heard=''

leave() {
    [[ $name ]] || { mkdir -p "$answers" && : >"$answers/terminated"; }
    exit 0
}

# As in start.sh.
pause() { # SECONDS
    read -rt "$1" -u 7
    (($? > 128)) || sleep "$1"
}

# Sets uptime [s].
read_uptime() {
    read -r uptime _ </proc/uptime
    uptime=${uptime%%.*}
}

# As is_fresh in start.sh.
is_expected() {
    read -r beat <"$here/heartbeat"
    read_uptime
    [[ $beat == "$last" ]] || { last=$beat heard=$uptime; }
    ((uptime - heard < (last ? silence : patience)))
}

agent_lives() { is_expected || { pause "$again"; is_expected; }; }

trap leave TERM INT
exec 7<> <(:)
read_uptime
heard=$uptime
until [[ -e $0 ]]; do
    read -r word <"$here/order"
    if [[ $word == end ]] || ! agent_lives; then leave; fi
    pause 0.05
done 2>/dev/null
eval "$image" 2>/dev/null
exec bash -p "$0" "$@"
