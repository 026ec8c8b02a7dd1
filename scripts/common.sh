# Sourced by the other scripts: strict mode, the root of the tree, messages and the number of parallel jobs.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# say TEXT...: one line that stands out between the output of other programs.
say() { printf '\n== %s\n' "$*"; }

# fail TEXT...: one line on standard error, exit code 1.
fail() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; exit 1; }

# num_jobs: one compiler a processor, but no more than fit into memory. The shading kernels are the largest thing to
# compile; 1.5 GiB a job leaves room for two of them side by side with the linker.
num_jobs()
{
  local processors available_kib by_memory
  processors=$(nproc)
  available_kib=$(awk '/^MemAvailable:/ { print $2 }' /proc/meminfo 2>/dev/null || true)
  by_memory=$(( ${available_kib:-0} / 1572864 ))
  if (( ${available_kib:-0} > 0 && by_memory < processors )); then
    echo $(( by_memory > 1 ? by_memory : 1 ))
  else
    echo "$processors"
  fi
}
