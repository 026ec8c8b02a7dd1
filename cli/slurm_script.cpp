#include "cli/slurm_script.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "cli/arguments.h"

namespace relief {

namespace {

bool has_frames(const SlurmJob& job) { return !job.chunks.front().empty(); }

/// What squeue shows: letters and digits of the scene's name.
std::string job_name(const SlurmJob& job)
{
  std::string name = "relief-" + std::filesystem::path(job.scene).stem().string();
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c >= 0x80 || std::isalnum(c) == 0; }, '-');
  return name;
}

/// What the output of a part is called, before and after its number.
std::pair<std::string, std::string> part_names(const SlurmJob& job)
{
  const std::filesystem::path output(job.output);
  const std::string stem = (output.parent_path() / output.stem()).string();
  return {stem + ".part-", fmt::format("-of-{}{}", job.parts, output.extension().string())};
}

/// The output of a part, for a shell: the number is a parameter of its own or a figure.
std::string part_file(const SlurmJob& job, const std::string& part)
{
  const auto [start, end] = part_names(job);
  return shell_quoted(start) + part + shell_quoted(end);
}

/// A function that says which frames a chunk has.
std::string frames_function(const SlurmJob& job)
{
  std::string text = "\n# Frames of a chunk.\nframes_of()\n{\n  case $1 in\n";
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    text += fmt::format("    {}) echo {} ;;\n", i + 1, frames_text(job.chunks[i]));
  }
  return text + "  esac\n}\n";
}

std::string render_function(const SlurmJob& job)
{
  std::string text = R"(
# One task of the array: a chunk of frames, and a part of their samples if there are several.
render()
{
)";
  text += fmt::format("  chunk=$((($1 - 1) / {0} + 1))\n", job.parts);
  if (job.parts > 1) text += fmt::format("  part=$((($1 - 1) % {} + 1))\n", job.parts);
  text += "  \"$relief\" render " + shell_quoted(job.scene) + " -o " +
          (job.parts > 1 ? part_file(job, "\"$part\"") : shell_quoted(job.output));
  if (has_frames(job)) text += " --frames \"$(frames_of \"$chunk\")\"";
  text += " --resume";
  // Halves would be rounded before they are added.
  if (job.parts > 1) text += fmt::format(" --part \"$part/{}\" --float", job.parts);
  if (job.sets_threads) text += " ${SLURM_CPUS_ON_NODE:+--threads \"$SLURM_CPUS_ON_NODE\"}";
  for (const std::string& word : job.render_options) text += " " + shell_quoted(word);
  return text + "\n}\n";
}

std::string merge_function(const SlurmJob& job)
{
  std::string text = R"(
# One task of the second array: the parts of a chunk of frames become pictures.
merge()
{
  "$relief" merge)";
  if (has_frames(job)) text += " --frames \"$(frames_of \"$1\")\"";
  for (int part = 1; part <= job.parts; ++part) text += " " + part_file(job, std::to_string(part));
  return text + " -o " + shell_quoted(job.output) + "\n}\n";
}

/// Runs a task; what may succeed another time is queued again.
constexpr const char* kRunFunction = R"(
# run COMMAND CODES: CODES are exit codes that would come again.
run()
{
  cd "$folder"
  status=0
  "$1" "$SLURM_ARRAY_TASK_ID" || status=$?
  [ "$status" -ne 0 ] || exit 0
  case " $2 " in
    *" $status "*) exit "$status" ;;
  esac
  if [ "${SLURM_RESTART_COUNT:-0}" -lt "$retries" ]; then
    echo "exit code $status: queued again" >&2
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID" || true
  fi
  exit "$status"
}
)";

std::string submit_function(const SlurmJob& job)
{
  const std::size_t tasks = job.chunks.size() * static_cast<std::size_t>(job.parts);
  std::string text = fmt::format(R"(
submit()
{{
  job=$(sbatch --parsable "$0" render)
  # A cluster's name may follow.
  job=${{job%%;*}}
  echo "render: job $job, {} tasks"
)",
                                 tasks);
  if (job.parts > 1) {
    text += fmt::format(
        R"(  job=$(sbatch --parsable --dependency="afterok:$job" --kill-on-invalid-dep=yes --array=1-{0} "$0" merge)
  echo "merge: job ${{job%%;*}}, {0} tasks, once all of these have succeeded"
)",
        job.chunks.size());
  }
  return text + "}\n";
}

}  // namespace

std::string slurm_part_output(const SlurmJob& job, int part)
{
  const auto [start, end] = part_names(job);
  return start + std::to_string(part) + end;
}

std::string slurm_script(const SlurmJob& job)
{
  std::size_t num_frames = 0;
  for (const std::vector<int>& chunk : job.chunks) num_frames += std::max<std::size_t>(chunk.size(), 1);
  std::string text = "#!/bin/sh\n";
  text += fmt::format("#SBATCH --job-name={}\n", job_name(job));
  text += fmt::format("#SBATCH --array=1-{}\n", job.chunks.size() * static_cast<std::size_t>(job.parts));
  text += "#SBATCH --requeue\n";
  for (const std::string& option : job.sbatch_options) text += "#SBATCH " + option + "\n";
  text += fmt::format(
      "# {} frame{}, {} part{} each. Written by relief farm slurm; run it to submit it, and again after a failure: "
      "what is\n"
      "# there already is left out.\n",
      num_frames, num_frames == 1 ? "" : "s", job.parts, job.parts == 1 ? "" : "s");
  text += "set -eu\n";
  text += "relief=" + shell_quoted(job.program) + "\n";
  text += "folder=" + shell_quoted(job.folder) + "\n";
  text += fmt::format("retries={}\n", job.retries);
  if (has_frames(job)) text += frames_function(job);
  text += render_function(job);
  if (job.parts > 1) text += merge_function(job);
  text += kRunFunction + submit_function(job);
  text += R"(
case ${1:-${SLURM_ARRAY_TASK_ID:+render}} in
  # Wrong usage, files that are no good, and a stop from outside.
  render) run render "2 3 130" ;;
)";
  // A part that is not there may still come, from a machine that Slurm has lost sight of.
  if (job.parts > 1) text += "  merge) run merge \"2 130\" ;;\n";
  return text + R"(  "" | submit) submit ;;
  *)
    echo "usage: $0 [submit]" >&2
    exit 2
    ;;
esac
)";
}

}  // namespace relief
