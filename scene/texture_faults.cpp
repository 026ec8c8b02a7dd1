#include "scene/texture_faults.h"

#include <algorithm>
#include <string>

namespace relief {

void TextureFaults::add(const SceneError& fault)
{
  const std::string text = fault.what();
  const bool is_known =
      std::any_of(faults_.begin(), faults_.end(), [&](const SceneError& f) { return f.what() == text; });
  if (!is_known) faults_.push_back(fault);
}

void TextureFaults::settle(bool goes_on, Warnings& warnings) const
{
  if (goes_on) {
    for (const SceneError& fault : faults_) warnings.add(std::string(fault.what()) + "; it is rendered as missing");
    return;
  }
  if (faults_.empty()) return;
  if (faults_.size() == 1) throw faults_.front();
  std::string all;
  for (const SceneError& fault : faults_) {
    const bool is_same_file = fault.file == faults_.front().file;
    all += (all.empty() ? "" : "; ") + (is_same_file ? fault.json_path : fault.file + ": " + fault.json_path) +
           " (expected " + fault.expected + ", found " + fault.found + ')';
  }
  throw SceneError(faults_.front().file, "", "textures that can be read",
                   std::to_string(faults_.size()) + " that cannot: " + all);
}

}  // namespace relief
