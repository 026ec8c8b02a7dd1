#include "displacement/prepared_mesh.h"

#include <utility>

namespace relief {

std::unique_ptr<PreparedMesh> KeptMeshes::take(const ContentHash& content)
{
  const auto at = meshes_.find(content);
  if (at == meshes_.end()) return nullptr;
  std::unique_ptr<PreparedMesh> mesh = std::move(at->second);
  meshes_.erase(at);
  ++taken_.count;
  taken_.bytes += mesh->mesh.bytes() + mesh->tree_bytes;
  taken_.seconds += mesh->seconds;
  return mesh;
}

void KeptMeshes::put(std::unique_ptr<PreparedMesh> mesh)
{
  const ContentHash content = *mesh->content;
  meshes_.emplace(content, std::move(mesh));
}

KeptMeshes::Tally KeptMeshes::end_set()
{
  meshes_.clear();
  return std::exchange(taken_, {});
}

}  // namespace relief
