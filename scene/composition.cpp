#include "scene/composition.h"

#include <algorithm>
#include <set>
#include <system_error>
#include <utility>

#include "scene/memory.h"

namespace relief {
namespace {

/// What an override sets on nodes of one name, or on the node of an index.
struct NodeOverride {
  std::optional<Vec3d> translation, scale;
  std::optional<Quaternion> rotation;
  std::optional<Transform> matrix;
  std::shared_ptr<const MaterialRule> material;  ///< null: none
};

/// Overrides of one reference.
struct OverrideSet {
  std::map<std::string, NodeOverride> by_name;    ///< of nodes; "/nodes/3" is the one of that index
  std::shared_ptr<const MaterialRule> materials;  ///< null: none
  std::string file, path, materials_path;         ///< for messages
  mutable std::set<std::string> used_names;       ///< written while walking, to warn about the others
};

/// RELIEF_reference of one node, resolved once however often the walk comes by.
struct Reference {
  const GltfDocument* target = nullptr;  ///< null: the node has none
  std::vector<int> roots;
  std::shared_ptr<const OverrideSet> overrides;
  std::string uri_path, uri;  ///< for messages
};

/// A file being walked, and through which references it was reached.
struct Scope {
  const GltfDocument* document = nullptr;
  std::shared_ptr<const Scope> outer;  ///< the scope of the file that refers to it; null for the root
  std::shared_ptr<const OverrideSet> overrides;
};

/// A node that waits to be visited.
struct Pending {
  std::shared_ptr<const Scope> scope;
  int node_index = 0;
  Transform parent_world;
  ObjectSettings object;
  bool animated = false;
  std::string defect_path;
};

std::string node_path(int index) { return "/nodes/" + std::to_string(index); }

Vec3d to_vec3d(const std::vector<double>& v) { return {v[0], v[1], v[2]}; }
Quaternion to_quaternion(const std::vector<double>& v) { return {v[0], v[1], v[2], v[3]}; }

Transform matrix_or_fail(const std::vector<double>& m, const std::string& file, const std::string& path)
{
  std::array<double, 16> numbers{};
  std::copy_n(m.begin(), 16, numbers.begin());
  const std::optional<Transform> t = transform_from_matrix(numbers);
  if (!t) {
    throw SceneError(file, path, "an affine matrix (column-major, last row 0 0 0 1)", "a projective one");
  }
  return *t;
}

/// The material of this file that a property names.
MaterialChoice read_material(const GltfDocument& document, const JsonReader& r, const std::string& property)
{
  const std::string name = r.string(property, "");
  const auto& materials = document.core.materials;
  const auto at = std::find_if(materials.begin(), materials.end(), [&](const auto& m) { return m.name == name; });
  if (at == materials.end()) {
    r.fail(property, "the name of a material in this file");
  }
  return {&document, static_cast<int>(at - materials.begin())};
}

NodeOverride read_override(const GltfDocument& document, const JsonReader& r, Warnings& warnings)
{
  constexpr double kLargest = std::numeric_limits<float>::max();
  NodeOverride o;
  if (const auto v = r.numbers("translation", 3, 3, -kLargest, kLargest); !v.empty()) o.translation = to_vec3d(v);
  if (const auto v = r.numbers("scale", 3, 3, -kLargest, kLargest); !v.empty()) o.scale = to_vec3d(v);
  if (const auto v = r.numbers("rotation", 4, 4, -1.001, 1.001); !v.empty()) o.rotation = to_quaternion(v);
  if (const auto v = r.numbers("matrix", 16, 16, -kLargest, kLargest); !v.empty()) {
    if (o.translation || o.rotation || o.scale) {
      r.fail("", "either matrix or translation, rotation and scale", "both");
    }
    o.matrix = matrix_or_fail(v, r.file(), json_path_join(r.path(), "matrix"));
  }
  if (r.has("material")) {
    auto rule = std::make_shared<MaterialRule>();
    rule->of_node = read_material(document, r, "material");
    o.material = std::move(rule);
  }
  r.warn_unread(warnings);
  return o;
}

/// Root nodes of the default scene; of the first scene, or of the whole file, if it names none.
std::vector<int> default_roots(const GltfDocument& document)
{
  const tinygltf::Model& core = document.core;
  if (!core.scenes.empty()) {
    return core.scenes[static_cast<std::size_t>(std::max(core.defaultScene, 0))].nodes;
  }
  std::vector<bool> is_child(core.nodes.size(), false);
  for (const tinygltf::Node& node : core.nodes) {
    for (const int child : node.children) {
      is_child[static_cast<std::size_t>(child)] = true;
    }
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < core.nodes.size(); ++i) {
    if (!is_child[i]) {
      roots.push_back(static_cast<int>(i));
    }
  }
  return roots;
}

class Walk {
 public:
  Walk(DocumentSet& documents,
       std::optional<double> time,
       Warnings& warnings,
       const std::function<void(const PlacedNode&)>& visit)
      : documents_(documents), time_(time), warnings_(warnings), visit_(visit)
  {
  }

  void run(const GltfDocument& root)
  {
    auto scope = std::make_shared<Scope>();
    scope->document = &root;
    push_all(default_roots(root), Pending{scope, 0, {}, {}, false, {}});
    // An explicit stack: a file may nest its nodes as deep as it likes.
    while (!stack_.empty()) {
      const Pending pending = std::move(stack_.back());
      stack_.pop_back();
      step(pending);
    }
    for (const auto& [key, reference] : reference_of_) {
      if (reference.overrides != nullptr) {
        warn_unused(*reference.overrides);
      }
    }
  }

 private:
  void warn_unused(const OverrideSet& overrides)
  {
    if (overrides.materials != nullptr) {
      for (const auto& [name, ignored] : overrides.materials->by_name) {
        if (overrides.materials->used_names.count(name) == 0) {
          warnings_.add(overrides.file + ": " + json_path_join(overrides.materials_path, name) +
                        ": no referenced mesh has a material of this name");
        }
      }
    }
    for (const auto& [name, ignored] : overrides.by_name) {
      if (overrides.used_names.count(name) == 0) {
        warnings_.add(overrides.file + ": " + json_path_join(overrides.path, name) +
                      ": no referenced node has this name or index");
      }
    }
  }

  /// Pushes nodes so that they are visited in the order given.
  void push_all(const std::vector<int>& nodes, const Pending& like)
  {
    for (auto it = nodes.rbegin(); it != nodes.rend(); ++it) {
      stack_.push_back(like);
      stack_.back().node_index = *it;
    }
  }

  void step(const Pending& pending)
  {
    const GltfDocument& document = *pending.scope->document;
    const std::string path = node_path(pending.node_index);
    // References that each double the last one multiply faster than any memory.
    constexpr std::size_t kMostNodes = std::size_t{1} << 22;
    if (++num_visited_ > kMostNodes) {
      throw SceneError(document.file, path, "at most " + std::to_string(kMostNodes) + " nodes after composition",
                       "more");
    }
    memory_.add(sizeof(Pending) + sizeof(Scope), document.file + ": " + path);
    PlacedNode placed;
    placed.document = &document;
    placed.node_index = pending.node_index;
    placed.animated = pending.animated;
    placed.defect_path = pending.defect_path;
    const tinygltf::Node& node = document.core.nodes[static_cast<std::size_t>(pending.node_index)];
    placed.weights = node.weights;
    if (placed.weights.empty() && node.mesh >= 0) {
      placed.weights = document.core.meshes[static_cast<std::size_t>(node.mesh)].weights;
    }
    const Transform local = local_transform(pending, placed);
    placed.world = pending.parent_world * local;
    if (placed.defect_path.empty() && transform_defect(local) != TransformDefect::kNone) {
      placed.defect_path = path;
    }
    placed.object = relief_object(document, pending.node_index, pending.object, warnings_);
    visit_(placed);

    const Pending child{pending.scope, 0, placed.world, placed.object, placed.animated, placed.defect_path};
    push_all(node.children, child);
    push_reference(child, pending.node_index);
  }

  /// Local transform with animation and overrides; fills the material override and `animated` of `placed` too.
  Transform local_transform(const Pending& pending, PlacedNode& placed)
  {
    const GltfDocument& document = *pending.scope->document;
    const tinygltf::Node& node = document.core.nodes[static_cast<std::size_t>(pending.node_index)];
    const std::string path = node_path(pending.node_index);
    Trs trs;
    std::optional<Transform> matrix;
    if (!node.matrix.empty()) {
      matrix = matrix_or_fail(node.matrix, document.file, path + "/matrix");
    }
    if (!node.translation.empty()) trs.translation = to_vec3d(node.translation);
    if (!node.rotation.empty()) trs.rotation = to_quaternion(node.rotation);
    if (!node.scale.empty()) trs.scale = to_vec3d(node.scale);
    if (const AnimatedPose* pose = pose_of(document, pending.node_index)) {
      placed.animated = true;
      trs.translation = pose->translation.value_or(trs.translation);
      trs.rotation = pose->rotation.value_or(trs.rotation);
      trs.scale = pose->scale.value_or(trs.scale);
      if (!pose->weights.empty()) placed.weights = pose->weights;
    }
    // From the innermost reference outwards, so that the outermost file has the last word.
    for (const Scope* s = pending.scope.get(); s != nullptr; s = s->outer.get()) {
      if (s->overrides == nullptr) {
        continue;
      }
      if (s->overrides->materials != nullptr) {
        placed.material_rules.push_back(s->overrides->materials);
      }
      // Indices are of the file that is referred to, and not of those that it refers to itself.
      const bool has_index = s->outer != nullptr && s == pending.scope.get();
      for (const std::string& name : {node.name, has_index ? path : std::string()}) {
        const auto it = s->overrides->by_name.find(name);
        if (!name.empty() && it != s->overrides->by_name.end()) {
          s->overrides->used_names.insert(name);
          apply(it->second, trs, matrix, placed, json_path_join(s->overrides->path, name), s->overrides->file);
        }
      }
    }
    return matrix ? *matrix : transform_from_trs(trs);
  }

  static void apply(const NodeOverride& o,
                    Trs& trs,
                    std::optional<Transform>& matrix,
                    PlacedNode& placed,
                    const std::string& path,
                    const std::string& file)
  {
    if (o.matrix) {
      matrix = o.matrix;
    } else if (matrix && (o.rotation || o.scale)) {
      throw SceneError(file, path, "a matrix or a translation, because the node has a matrix", "rotation or scale");
    } else if (matrix && o.translation) {
      matrix->p = *o.translation;
    }
    trs.translation = o.translation.value_or(trs.translation);
    trs.rotation = o.rotation.value_or(trs.rotation);
    trs.scale = o.scale.value_or(trs.scale);
    if (o.material != nullptr) {
      placed.material_rules.push_back(o.material);
    }
  }

  const AnimatedPose* pose_of(const GltfDocument& document, int node_index)
  {
    if (!time_ || document.core.animations.empty()) {
      return nullptr;
    }
    auto it = poses_.find(&document);
    if (it == poses_.end()) {
      it = poses_.emplace(&document, animation_pose(document, *time_, warnings_)).first;
    }
    const auto pose = it->second.find(node_index);
    return pose == it->second.end() ? nullptr : &pose->second;
  }

  /// If the node refers to another file, pushes that file's nodes as its children.
  void push_reference(const Pending& child, int node_index)
  {
    const GltfDocument& document = *child.scope->document;
    const auto& node = document.element("nodes", static_cast<std::size_t>(node_index));
    if (node.find("extensions") == node.end()) {
      return;
    }
    const Reference& reference = reference_of(document, node_index);
    if (reference.target == nullptr) {
      return;
    }
    for (const Scope* s = child.scope.get(); s != nullptr; s = s->outer.get()) {
      if (s->document == reference.target) {
        throw SceneError(document.file, reference.uri_path, "a file that does not lead back here",
                         '"' + reference.uri + "\" (a cycle of references)");
      }
    }
    auto scope = std::make_shared<Scope>();
    scope->document = reference.target;
    scope->outer = child.scope;
    scope->overrides = reference.overrides;
    Pending below = child;
    below.scope = scope;
    push_all(reference.roots, below);
  }

  const Reference& reference_of(const GltfDocument& document, int node_index)
  {
    const auto [it, is_new] = reference_of_.try_emplace({&document, node_index});
    Reference& reference = it->second;
    if (!is_new) {
      return reference;
    }
    const auto& node = document.element("nodes", static_cast<std::size_t>(node_index));
    document.read_extension(node, node_path(node_index), "RELIEF_reference", [&](const JsonReader& r) {
      if (!r.has("uri")) {
        r.fail("uri", "a path");
      }
      reference.uri = r.string("uri", "");
      reference.uri_path = json_path_join(r.path(), "uri");
      reference.target = &documents_.load(gltf_resolve_uri(document, reference.uri, reference.uri_path), warnings_);
      reference.overrides = read_overrides(document, r);
      reference.roots = reference_roots(*reference.target, r);
      r.warn_unread(warnings_);
    });
    return reference;
  }

  static std::vector<int> reference_roots(const GltfDocument& target, const JsonReader& r)
  {
    if (!r.has("node")) {
      return default_roots(target);
    }
    if (r.raw("node").is_number()) {
      return {r.index("node", target.core.nodes.size(), "nodes")};
    }
    const std::string name = r.string("node", "");
    const auto& nodes = target.core.nodes;
    const auto at = std::find_if(nodes.begin(), nodes.end(), [&](const auto& n) { return n.name == name; });
    if (at == nodes.end()) {
      r.fail("node", "the name or the index of a node in " + target.file);
    }
    return {static_cast<int>(at - nodes.begin())};
  }

  std::shared_ptr<const OverrideSet> read_overrides(const GltfDocument& document, const JsonReader& r)
  {
    if (!r.has("overrides") && !r.has("materials")) {
      return nullptr;
    }
    auto set = std::make_shared<OverrideSet>();
    set->file = document.file;
    if (r.has("overrides")) {
      const JsonReader overrides = r.object("overrides");
      set->path = overrides.path();
      for (const auto& item : r.raw("overrides").items()) {
        set->by_name[item.key()] = read_override(document, overrides.object(item.key()), warnings_);
      }
    }
    if (r.has("materials")) {
      const JsonReader materials = r.object("materials");
      auto rule = std::make_shared<MaterialRule>();
      for (const auto& item : r.raw("materials").items()) {
        rule->by_name[item.key()] = read_material(document, materials, item.key());
      }
      set->materials_path = materials.path();
      set->materials = std::move(rule);
    }
    return set;
  }

  DocumentSet& documents_;
  std::optional<double> time_;
  Warnings& warnings_;
  const std::function<void(const PlacedNode&)>& visit_;
  std::vector<Pending> stack_;
  std::size_t num_visited_ = 0;
  MemoryWatch memory_;
  std::map<const GltfDocument*, std::unordered_map<int, AnimatedPose>> poses_;
  std::map<std::pair<const GltfDocument*, int>, Reference> reference_of_;
};

}  // namespace

const GltfDocument& DocumentSet::load(const std::filesystem::path& path, Warnings& warnings)
{
  std::error_code error;
  std::filesystem::path key = std::filesystem::weakly_canonical(path, error);
  if (error) {
    key = path;
  }
  auto it = by_path_.find(key);
  if (it == by_path_.end()) {
    documents_.push_back(gltf_document_load(path, warnings));
    it = by_path_.emplace(key, documents_.back().get()).first;
  }
  return *it->second;
}

std::vector<FileStamp> DocumentSet::files_read() const
{
  std::vector<FileStamp> out;
  for (const auto& document : documents_) {
    out.insert(out.end(), document->files_read.begin(), document->files_read.end());
  }
  return out;
}

std::optional<MaterialChoice> material_choice(const PlacedNode& node, const std::string& name)
{
  std::optional<MaterialChoice> choice;
  for (const auto& rule : node.material_rules) {
    if (rule->of_node.document != nullptr) choice = rule->of_node;
    auto found = rule->by_name.find(name);
    if (found == rule->by_name.end()) found = rule->by_name.find("*");
    if (found == rule->by_name.end()) continue;
    rule->used_names.insert(found->first);
    choice = found->second;
  }
  return choice;
}

void composition_traverse(DocumentSet& documents,
                          const GltfDocument& root,
                          std::optional<double> time_seconds,
                          Warnings& warnings,
                          const std::function<void(const PlacedNode&)>& visit)
{
  Walk(documents, time_seconds, warnings, visit).run(root);
}

}  // namespace relief
