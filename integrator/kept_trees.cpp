#include "integrator/kept_trees.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "scene/memory.h"

namespace relief {

/// Embree asks before each block that it takes, and gives up the build where the answer is no. How large a tree gets is not
/// known before, so that is where its memory is bounded.
bool KeptTrees::Device::count(void* user, ssize_t more, bool)
{
  Device& device = *static_cast<Device*>(user);
  device.bytes.fetch_add(more, std::memory_order_relaxed);
  if (more <= 0) return true;
  constexpr std::ptrdiff_t kStep = std::ptrdiff_t{16} << 20;
  const std::ptrdiff_t unchecked = device.unchecked.fetch_add(more, std::memory_order_relaxed) + more;
  if (unchecked < kStep) return true;
  device.unchecked.store(0, std::memory_order_relaxed);
  try {
    memory_require(static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(more, kStep)), "the acceleration structure");
    return true;
  } catch (const OutOfMemory& error) {
    device.bytes.fetch_sub(more, std::memory_order_relaxed);
    const std::lock_guard lock(device.mutex);
    device.refusal = error;
    return false;
  }
}

std::optional<OutOfMemory> KeptTrees::refusal() const
{
  const std::lock_guard lock(device_->mutex);
  return std::exchange(device_->refusal, std::nullopt);
}

KeptTrees::Device::~Device()
{
  if (device != nullptr) rtcReleaseDevice(device);
}

KeptTrees::KeptTrees(bool keeps) : keeps_(keeps), device_(std::make_shared<Device>())
{
  device_->device = rtcNewDevice(nullptr);
  if (device_->device == nullptr) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY) throw OutOfMemory("the start of Embree");
    throw std::runtime_error("Embree cannot start on this machine");
  }
  rtcSetDeviceMemoryMonitorFunction(device_->device, Device::count, device_.get());
}

TreePointer KeptTrees::scene_make() const
{
  TreePointer tree = own(rtcNewScene(device()));
  rtcSetSceneFlags(tree.get(), static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | kSceneTakesFilter));
  return tree;
}

TreePointer KeptTrees::own(RTCScene scene) const
{
  // The device counts bytes until its last scene has gone.
  return TreePointer(scene, [device = device_](RTCScene s) {
    if (s != nullptr) rtcReleaseScene(s);
  });
}

TreePointer KeptTrees::mesh_tree(const ContentHash& content, const std::function<TreePointer()>& build)
{
  if (!keeps_) return build();
  if (const auto at = meshes_.find(content); at != meshes_.end()) {
    MeshTree& known = at->second;
    if (!std::exchange(known.is_wanted, true)) {
      ++found_.count;
      found_.bytes += known.bytes;
      found_.seconds += known.seconds;
    }
    return known.tree;
  }
  const auto start = std::chrono::steady_clock::now();
  const std::uint64_t bytes_before = bytes();
  MeshTree made;
  made.tree = build();
  made.bytes = bytes() - bytes_before;
  made.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return meshes_.emplace(content, std::move(made)).first->second.tree;
}

std::unique_ptr<SceneTree> KeptTrees::take(const ContentHash& content)
{
  std::unique_ptr<SceneTree> tree = std::move(scene_);
  if (tree == nullptr || tree->content != content) return nullptr;
  found_.count += tree->num_in_place;
  found_.bytes += tree->bytes;
  found_.seconds += tree->seconds;
  return tree;
}

KeptTrees::Tally KeptTrees::end_scene()
{
  std::erase_if(meshes_, [](const auto& mesh) { return !mesh.second.is_wanted; });
  for (auto& [content, mesh] : meshes_) mesh.is_wanted = false;
  return std::exchange(found_, {});
}

}  // namespace relief
