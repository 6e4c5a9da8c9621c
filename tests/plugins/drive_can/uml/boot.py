"""Real SocketCAN on a machine whose kernel has none: User-Mode Linux, unpacked from Debian packages, not installed.

`python tests/plugins/drive_can/uml/boot.py fetch` unpacks the packages into .tools/uml (42 MB, once);
`... boot.py run` boots it on this file system, makes vcan0 and runs contract_on_vcan.py inside. No root, no KVM.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
PLACE = ROOT / ".tools" / "uml"
KERNEL = PLACE / "usr" / "bin" / "linux.uml"
BUSYBOX = PLACE / "bin" / "busybox"
PACKAGES = ("user-mode-linux", "busybox-static")
MODULES = ("net/can/can", "net/can/can-raw", "drivers/net/can/dev/can-dev", "drivers/net/can/vcan")
BOOT_WITHIN_S = 300

INIT = """#!{busybox} sh
B={busybox}
export PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin HOME={scratch} TMPDIR={scratch} CI= CHAIRWARD_VCAN=vcan0
$B mount -t proc proc /proc
$B mount -t sysfs sys /sys
$B mount -t tmpfs tmp {scratch}
for module in {modules}; do $B insmod $module || echo "insmod $module failed"; done
$B ip link set lo up
$B ip link add dev vcan0 type vcan && $B ip link set vcan0 up
cd {root}
{command} && echo {good}
$B sync
$B poweroff -f
"""
GOOD = "chairward: all is well on vcan0"


def fetched() -> bool:
    """Whether the kernel is there already."""
    return KERNEL.exists() and BUSYBOX.exists()


def fetch() -> None:
    """Download both packages and unpack them. Raises OSError or CalledProcessError."""
    PLACE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        download = ["apt-get", "download", "-q", *PACKAGES]
        if subprocess.run(download, cwd=folder, check=False, capture_output=True).returncode:
            root = [] if os.geteuid() == 0 else ["sudo", "-n"]  # a new machine has no package lists yet
            subprocess.run([*root, "apt-get", "update", "-qq"], check=True, capture_output=True)
            subprocess.run(download, cwd=folder, check=True, capture_output=True)
        for package in Path(folder).glob("*.deb"):
            subprocess.run(["dpkg-deb", "-x", package, PLACE], check=True, capture_output=True)


def run(command: str) -> subprocess.CompletedProcess[str]:
    """Boot, run `command` inside at the project's root, power off. Good when GOOD is in the output."""
    version = next((PLACE / "usr" / "lib" / "uml" / "modules").iterdir())
    modules = " ".join(str(version / "kernel" / f"{module}.ko") for module in MODULES)
    with tempfile.TemporaryDirectory() as folder:
        init, scratch = Path(folder) / "init.sh", Path(folder) / "scratch"
        scratch.mkdir()  # its own, in memory: mounting over /tmp would hide a checkout that is there
        init.write_text(
            INIT.format(busybox=BUSYBOX, modules=modules, root=ROOT, scratch=scratch, command=command, good=GOOD)
        )
        init.chmod(0o755)
        return subprocess.run(
            [
                KERNEL, "mem=512M", "rootfstype=hostfs", "root=/dev/root", "rootflags=/", "rw", f"init={init}",
                "con=null", "con0=fd:0,fd:1", f"umid=chairward{os.getpid()}", "quiet",
            ],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", timeout=BOOT_WITHIN_S,
            env={**os.environ, "HOME": folder}, check=False,
        )  # fmt: skip


def run_contract() -> subprocess.CompletedProcess[str]:
    """The drive contract on vcan0."""
    tests = HERE / "contract_on_vcan.py"
    # python-can forgets to close its socket when an interface is not there: a ResourceWarning that is not ours.
    options = "-q -n0 --color=no -W ignore::ResourceWarning -p no:cacheprovider --timeout=200"
    return run(f"{sys.executable} -m pytest {options} {tests}")


def main() -> int:
    if sys.argv[1:] == ["fetch"]:
        if not shutil.which("apt-get"):
            sys.stderr.write("apt-get is not here: this works on Debian and its relatives\n")
            return 2
        fetch()
        return 0
    if not fetched():
        sys.stderr.write(f"{KERNEL} is missing: python {Path(__file__).relative_to(ROOT)} fetch\n")
        return 2
    done = run_contract()
    sys.stdout.write(done.stdout)
    return 0 if GOOD in done.stdout else 1


if __name__ == "__main__":
    sys.exit(main())
