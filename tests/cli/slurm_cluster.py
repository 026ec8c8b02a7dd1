"""A Slurm cluster on this machine: munge, the controller and two nodes, on loopback only, their files in a folder of their own."""

import os
import pathlib
import pwd
import shutil
import socket
import subprocess
import time

PROGRAMS = ("munged", "mungekey", "slurmctld", "slurmd", "sbatch", "squeue", "sinfo", "scontrol")


def missing():
    """Why there can be no cluster; empty: it can."""
    lacking = [program for program in PROGRAMS if shutil.which(program) is None]
    if lacking:
        return f"{', '.join(lacking)}: not installed"
    return "" if os.geteuid() == 0 else "daemons of nodes need root"


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Cluster:
    """Daemons that end with the object's `close`, jobs with them."""

    NODES = ("n1", "n2")

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.daemons = {}
        control, *ports = free_ports(1 + len(self.NODES))
        for name in ("munge", "state"):
            (self.folder / name).mkdir(mode=0o755)
        nodes = "".join(f"NodeName={name} NodeAddr=127.0.0.1 NodeHostname=localhost Port={port} CPUs=1 RealMemory=1000\n"
                        for name, port in zip(self.NODES, ports))
        config = self.folder / "slurm.conf"
        config.write_text(f"""ClusterName=test
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={control}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
AuthType=auth/munge
AuthInfo=socket={self.folder}/munge/socket,cred_expire=5
SlurmUser=root
StateSaveLocation={self.folder}/state
SlurmdSpoolDir={self.folder}/spool.%n
SlurmctldPidFile={self.folder}/slurmctld.pid
SlurmdPidFile={self.folder}/slurmd.%n.pid
SlurmctldLogFile={self.folder}/slurmctld.log
SlurmdLogFile={self.folder}/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MpiDefault=none
MailProg=/bin/true
ReturnToService=2
SlurmdTimeout=10
KillWait=1
SchedulerParameters=sched_interval=2,bf_interval=2
{nodes}PartitionName=main Nodes=ALL Default=YES State=UP
""")
        self.environment = {**os.environ, "SLURM_CONF": str(config)}
        key = self.folder / "munge" / "key"
        subprocess.run(["mungekey", "--create", f"--keyfile={key}"], check=True)
        self.start("munged", "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.folder}/munge/socket",
                   f"--pid-file={self.folder}/munge/pid", f"--seed-file={self.folder}/munge/seed", f"--log-file={self.folder}/munge/log")
        self.wait_for(lambda: (self.folder / "munge" / "socket").exists(), "munge")
        self.start("slurmctld", "slurmctld", "-D", "-c", "-f", config)
        for name in self.NODES:
            self.start_node(name)
        self.wait_for(lambda: self.nodes("idle") == set(self.NODES), "the nodes")

    def start(self, name, *command):
        with open(self.folder / f"{name}.out", "ab") as output:
            self.daemons[name] = subprocess.Popen(list(map(str, command)), env=self.environment, stdin=subprocess.DEVNULL,
                                                  stdout=output, stderr=output, start_new_session=True)

    def start_node(self, name):
        self.start(name, "slurmd", "-D", "-N", name, "-f", self.folder / "slurm.conf")

    def wait_for(self, condition, what, seconds=120):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"{what}\n{self.ask('squeue')}\n{self.ask('sinfo')}\n{self.log()}")
            time.sleep(0.2)

    def log(self):
        return "\n".join((self.folder / "slurmctld.log").read_text(errors="replace").split("\n")[-40:])

    def ask(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False).stdout

    def nodes(self, state):
        return set(self.ask("sinfo", "-h", "-N", "-o", "%N", "-t", state).split())

    def jobs(self):
        """Tasks that wait or run: {"12_3": (state, node)}."""
        listed = self.ask("squeue", "-h", "-r", "-o", "%i %T %N").split("\n")[:-1]
        return {words[0]: (words[1], words[2] if len(words) > 2 else "") for words in map(str.split, listed)}

    def kill_node(self, name):
        """Its daemon and all that runs there, as when a machine loses its power. Others' processes have another spool folder."""
        daemon = self.daemons.pop(name)
        daemon.kill()
        daemon.wait()
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                environment = (process / "environ").read_bytes().split(b"\0")
                command = (process / "cmdline").read_bytes()
            except OSError:
                continue
            if f"SLURM_CONF={self.folder}/slurm.conf".encode() not in environment:
                continue
            if f"SLURMD_NODENAME={name}".encode() in environment or (b"slurmstepd" in command and self.node_of_step(process) == name):
                try:
                    os.kill(int(process.name), 9)
                except ProcessLookupError:
                    pass

    def node_of_step(self, process):
        """The node whose job a step's daemon looks after; its children know."""
        children = (process / "task" / process.name / "children").read_text().split()
        for child in children:
            try:
                for entry in pathlib.Path("/proc", child, "environ").read_bytes().split(b"\0"):
                    if entry.startswith(b"SLURMD_NODENAME="):
                        return entry.split(b"=", 1)[1].decode()
            except OSError:
                pass
        return ""

    def close(self):
        self.ask("scancel", "--user", pwd.getpwuid(os.geteuid()).pw_name)
        for name in reversed(list(self.daemons)):
            self.daemons[name].terminate()
        for daemon in self.daemons.values():
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
