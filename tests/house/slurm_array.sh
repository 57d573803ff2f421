#!/bin/sh
# Runs an array job on a Slurm of its own: the controller and two nodes on this host in a network namespace, without
# munge. Ends when the job has ended.
# usage: unshare -n slurm_array.sh FOLDER TASKS SCRIPT WORDS...     (as root; FOLDER: logs and state)
set -u
folder=$1 tasks=$2
shift 2
user=$(id -un) host=$(hostname)
ip link set lo up
# the resolver serves no numbers to a host that has the addresses 127.* alone
ip address add 192.0.2.1/32 dev lo
mkdir -p "$folder/state" "$folder/n1" "$folder/n2"
# the names resolve to this host, the ports tell the nodes apart; every state stands in the folder
cat >"$folder/slurm.conf" <<END
ClusterName=test
SlurmctldHost=$host(192.0.2.1)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/none
CredType=cred/none
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
NodeName=n[1-2] NodeAddr=192.0.2.1 NodeHostname=$host Port=[17001-17002] CPUs=1
PartitionName=all Nodes=n[1-2] Default=YES State=UP
END
export SLURM_CONF="$folder/slurm.conf"
slurmctld -D >"$folder/slurmctld.log" 2>&1 &
controller=$!
slurmd -D -N n1 >"$folder/n1.log" 2>&1 &
node1=$!
slurmd -D -N n2 >"$folder/n2.log" 2>&1 &
node2=$!
trap 'kill $controller $node1 $node2 2>/dev/null; wait' EXIT
# sbatch itself waits for the controller, and for the end of the job
sbatch --wait --chdir="$folder" --output="$folder/task-%a.log" --array="$tasks" "$@"
