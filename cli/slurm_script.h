// The job script that renders a shot on a Slurm cluster.
#pragma once

#include <string>
#include <vector>

namespace relief {

struct SlurmJob {
  std::string program;  ///< absolute path of relief, the same on all machines
  std::string folder;   ///< that relative names are from
  std::string scene, output;
  std::vector<std::vector<int>> chunks;  ///< frames of each; one that is empty: the rest pose
  int parts = 1;                         ///< tasks that share the samples of a frame
  int retries = 2;                       ///< how often a task that fails is queued again
  std::vector<std::string> render_options, sbatch_options;
  bool sets_threads = true;  ///< by what Slurm has given the task
};

/// A script for any POSIX shell. Run by itself it submits the render as an array job, a task for each chunk and part, and, if
/// there are parts, an array job that joins them once all are there. Whatever was made is left out when it is run again.
/// @pre output has a run of # if there are frames
std::string slurm_script(const SlurmJob& job);

/// Where a part of a frame goes, counted from 1; with the output's run of #.
std::string slurm_part_output(const SlurmJob& job, int part);

}  // namespace relief
