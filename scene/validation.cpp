#include "scene/validation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <vector>

#include "scene/file_kind.h"
#include "scene/json_reader.h"
#include "scene/memory.h"

namespace relief {

using nlohmann::json;

namespace {

constexpr double kNoLimit = JsonReader::kNoLimit;
/// Sizes and offsets: everything below is exact in a double and sums of a few do not overflow 64 bits.
constexpr double kLargestSize = 9007199254740992.0;
constexpr double kLargestInt = std::numeric_limits<int>::max();
constexpr double kLargestFloat = std::numeric_limits<float>::max();

enum class Kind : std::uint8_t {
  kInteger,  // low…high
  kIndex,    // into the top-level array `target`
  kNumber,   // low…high
  kString,   // any, or one of `labels` (separated by '|')
  kBoolean,
  kNumbers,   // array of length shortest…longest, each low…high
  kIndices,   // array of different indices into `target`
  kIndexMap,  // object whose values are indices into `target`
  kObject,    // `fields`
  kObjects,   // array of objects
};

/// One property of an object: how it must look.
struct Field {
  std::string_view name;
  Kind kind;
  bool required = false;
  double low = -kNoLimit, high = kNoLimit;
  std::size_t shortest = 0, longest = std::numeric_limits<std::size_t>::max();
  std::string_view target = {};     ///< kIndex…: array; kString: labels
  std::string_view otherwise = {};  ///< kString: what any other value means, after a warning; empty: that is an error
  bool clamps = false;              ///< kNumber, kNumbers: what is out of range counts as its end, after a warning
  std::span<const Field> fields = {};
};

constexpr Field integer(std::string_view name, double low, double high, bool required = false)
{
  return {.name = name, .kind = Kind::kInteger, .required = required, .low = low, .high = high};
}
constexpr Field index(std::string_view name, std::string_view target, bool required = false)
{
  return {.name = name, .kind = Kind::kIndex, .required = required, .target = target};
}
constexpr Field number(std::string_view name, double low, double high, bool required = false)
{
  return {.name = name, .kind = Kind::kNumber, .required = required, .low = low, .high = high};
}
constexpr Field string(std::string_view name, std::string_view labels = {}, bool required = false)
{
  return {.name = name, .kind = Kind::kString, .required = required, .target = labels};
}
/// One of some labels; what else files have there counts as `otherwise`.
constexpr Field choice(std::string_view name, std::string_view labels, std::string_view otherwise)
{
  return {.name = name, .kind = Kind::kString, .target = labels, .otherwise = otherwise};
}
/// Factors of materials, which files have a little beyond their range.
constexpr Field factor(std::string_view name, double high)
{
  return {.name = name, .kind = Kind::kNumber, .low = 0, .high = high, .clamps = true};
}
constexpr Field factors(std::string_view name, std::size_t count, double high)
{
  return {.name = name,
          .kind = Kind::kNumbers,
          .low = 0,
          .high = high,
          .shortest = count,
          .longest = count,
          .clamps = true};
}
constexpr Field boolean(std::string_view name) { return {.name = name, .kind = Kind::kBoolean}; }
constexpr Field numbers(std::string_view name,
                        std::size_t count,
                        double low = -kLargestFloat,
                        double high = kLargestFloat)
{
  return {.name = name, .kind = Kind::kNumbers, .low = low, .high = high, .shortest = count, .longest = count};
}
constexpr Field indices(std::string_view name, std::string_view target)
{
  return {.name = name, .kind = Kind::kIndices, .target = target};
}
constexpr Field object(std::string_view name, std::span<const Field> fields, bool required = false)
{
  return {.name = name, .kind = Kind::kObject, .required = required, .fields = fields};
}
constexpr Field objects(std::string_view name,
                        std::span<const Field> fields,
                        bool required = false,
                        std::size_t shortest = 0)
{
  return {.name = name, .kind = Kind::kObjects, .required = required, .shortest = shortest, .fields = fields};
}

/// Weights of morph targets, as many as there are.
constexpr Field weights()
{
  return {.name = "weights", .kind = Kind::kNumbers, .low = -kLargestFloat, .high = kLargestFloat, .shortest = 1};
}

constexpr Field kAsset[] = {string("version", {}, true), string("generator")};
constexpr Field kScene[] = {string("name"), indices("nodes", "nodes")};
constexpr Field kNode[] = {string("name"),
                           indices("children", "nodes"),
                           index("mesh", "meshes"),
                           index("camera", "cameras"),
                           numbers("matrix", 16),
                           numbers("translation", 3),
                           numbers("rotation", 4, -1.001, 1.001),
                           numbers("scale", 3),
                           weights()};
constexpr Field kTarget[] = {index("POSITION", "accessors"), index("NORMAL", "accessors")};
constexpr Field kPrimitive[] = {
    {.name = "attributes", .kind = Kind::kIndexMap, .required = true, .target = "accessors"},
    index("indices", "accessors"),
    index("material", "materials"),
    integer("mode", 0, 6),
    objects("targets", kTarget)};
constexpr Field kMesh[] = {string("name"), objects("primitives", kPrimitive, true, 1), weights()};
constexpr Field kSparseIndices[] = {index("bufferView", "bufferViews", true), integer("byteOffset", 0, kLargestInt),
                                    integer("componentType", 5121, 5125, true)};
constexpr Field kSparseValues[] = {index("bufferView", "bufferViews", true), integer("byteOffset", 0, kLargestInt)};
constexpr Field kSparse[] = {integer("count", 1, kLargestInt, true), object("indices", kSparseIndices, true),
                             object("values", kSparseValues, true)};
constexpr Field kAccessor[] = {index("bufferView", "bufferViews"),
                               integer("byteOffset", 0, kLargestSize),
                               integer("componentType", 5120, 5126, true),
                               boolean("normalized"),
                               integer("count", 1, kLargestSize, true),
                               string("type", "SCALAR|VEC2|VEC3|VEC4|MAT2|MAT3|MAT4", true),
                               object("sparse", kSparse)};
constexpr Field kBufferView[] = {index("buffer", "buffers", true), integer("byteOffset", 0, kLargestSize),
                                 integer("byteLength", 0, kLargestSize, true), integer("byteStride", 4, 252)};
constexpr Field kBuffer[] = {string("uri"), integer("byteLength", 0, kLargestSize, true)};
constexpr Field kImage[] = {string("name"), string("uri"), string("mimeType"), index("bufferView", "bufferViews")};
constexpr Field kTexture[] = {index("sampler", "samplers"), index("source", "images")};
constexpr Field kSampler[] = {integer("magFilter", 9728, 9729), integer("minFilter", 9728, 9987),
                              integer("wrapS", 10497, 33648), integer("wrapT", 10497, 33648)};
constexpr Field kTextureInfo[] = {index("index", "textures", true), integer("texCoord", 0, kLargestInt)};
constexpr Field kNormalTexture[] = {index("index", "textures", true), integer("texCoord", 0, kLargestInt),
                                    number("scale", -kLargestFloat, kLargestFloat)};
constexpr Field kPbr[] = {factors("baseColorFactor", 4, 1), object("baseColorTexture", kTextureInfo),
                          factor("metallicFactor", 1), factor("roughnessFactor", 1),
                          object("metallicRoughnessTexture", kTextureInfo)};
constexpr Field kMaterial[] = {string("name"),
                               object("pbrMetallicRoughness", kPbr),
                               object("normalTexture", kNormalTexture),
                               object("emissiveTexture", kTextureInfo),
                               factors("emissiveFactor", 3, kLargestFloat),
                               choice("alphaMode", "OPAQUE|MASK|BLEND", "OPAQUE"),
                               factor("alphaCutoff", kLargestFloat),
                               boolean("doubleSided")};
constexpr Field kPerspective[] = {number("aspectRatio", 1e-6, 1e6), number("yfov", 1e-6, 3.14159, true),
                                  number("zfar", 0, kNoLimit), number("znear", 0, kNoLimit)};
constexpr Field kOrthographic[] = {number("xmag", -kLargestFloat, kLargestFloat, true),
                                   number("ymag", -kLargestFloat, kLargestFloat, true), number("zfar", 0, kNoLimit),
                                   number("znear", 0, kNoLimit)};
constexpr Field kCamera[] = {string("name"), string("type", "perspective|orthographic", true),
                             object("perspective", kPerspective), object("orthographic", kOrthographic)};
constexpr Field kChannelTarget[] = {index("node", "nodes"), string("path", {}, true)};
constexpr Field kChannel[] = {integer("sampler", 0, kLargestInt, true), object("target", kChannelTarget, true)};
constexpr Field kAnimationSampler[] = {index("input", "accessors", true),
                                       choice("interpolation", "LINEAR|STEP|CUBICSPLINE", "LINEAR"),
                                       index("output", "accessors", true)};
constexpr Field kAnimation[] = {string("name"), objects("channels", kChannel, true),
                                objects("samplers", kAnimationSampler, true)};
constexpr Field kDocument[] = {object("asset", kAsset, true),
                               index("scene", "scenes"),
                               objects("scenes", kScene),
                               objects("nodes", kNode),
                               objects("meshes", kMesh),
                               objects("accessors", kAccessor),
                               objects("bufferViews", kBufferView),
                               objects("buffers", kBuffer),
                               objects("images", kImage),
                               objects("textures", kTexture),
                               objects("samplers", kSampler),
                               objects("materials", kMaterial),
                               objects("cameras", kCamera),
                               objects("animations", kAnimation)};

/// Extensions whose data is read.
constexpr std::string_view kSupportedExtensions[] = {"KHR_lights_punctual",
                                                     "KHR_materials_transmission",
                                                     "KHR_materials_ior",
                                                     "KHR_materials_volume",
                                                     "KHR_materials_clearcoat",
                                                     "KHR_materials_sheen",
                                                     "KHR_materials_specular",
                                                     "KHR_materials_emissive_strength",
                                                     "KHR_materials_unlit",
                                                     "KHR_texture_transform",
                                                     "KHR_mesh_quantization",
                                                     "EXT_mesh_gpu_instancing",
                                                     "KHR_materials_displacement",
                                                     "RELIEF_displacement",
                                                     "RELIEF_graph",
                                                     "RELIEF_surface",
                                                     "RELIEF_volume",
                                                     "RELIEF_light",
                                                     "RELIEF_area_light",
                                                     "RELIEF_environment",
                                                     "RELIEF_camera",
                                                     "RELIEF_render",
                                                     "RELIEF_object",
                                                     "RELIEF_curves",
                                                     "RELIEF_points",
                                                     "RELIEF_reference"};

/// Walks a document along the table above.
class Conformer {
 public:
  Conformer(const json& document, const std::string& file, Warnings& warnings)
      : document_(document), file_(file), warnings_(warnings)
  {
  }

  json conform_object(const json& value, std::span<const Field> fields, const std::string& path) const
  {
    if (!value.is_object()) {
      throw SceneError(file_, path.empty() ? "/" : path, "an object", json_describe(value));
    }
    json out = json::object();
    for (const Field& field : fields) {
      const auto it = value.find(field.name);
      if (it != value.end()) {
        out[std::string(field.name)] = conform_field(*it, field, json_path_join(path, field.name));
      } else if (field.required) {
        throw SceneError(file_, json_path_join(path, field.name), "a value (the property is required)", "nothing");
      }
    }
    return out;
  }

 private:
  [[noreturn]] void fail(const std::string& path, const std::string& expected, const json& found) const
  {
    throw SceneError(file_, path, expected, json_describe(found));
  }

  void warn(const std::string& path, const std::string& expected, const json& found, const std::string& used) const
  {
    warnings_.add(file_ + ": " + path + ": expected " + expected + ", found " + json_describe(found) + "; " + used +
                  " is used");
  }

  json conform_field(const json& value, const Field& field, const std::string& path) const
  {
    switch (field.kind) {
      case Kind::kInteger:
        return conform_integer(value, field.low, field.high, path);
      case Kind::kIndex:
        return conform_index(value, field.target, path);
      case Kind::kNumber:
        return conform_number(value, field, path);
      case Kind::kString:
        return conform_string(value, field, path);
      case Kind::kBoolean:
        if (!value.is_boolean()) {
          fail(path, "true or false", value);
        }
        return value;
      case Kind::kObject:
        return conform_object(value, field.fields, path);
      case Kind::kIndexMap:
        return conform_index_map(value, field, path);
      case Kind::kNumbers:
      case Kind::kIndices:
      case Kind::kObjects:
        break;
    }
    return conform_array(value, field, path);
  }

  json conform_array(const json& value, const Field& field, const std::string& path) const
  {
    if (!value.is_array() || value.size() < field.shortest || value.size() > field.longest) {
      fail(path,
           field.longest == field.shortest ? "an array of " + std::to_string(field.shortest)
           : field.shortest > 0            ? "an array that is not empty"
                                           : "an array",
           value);
    }
    json out = json::array();
    for (std::size_t i = 0; i < value.size(); ++i) {
      const std::string element_path = json_path_join(path, i);
      switch (field.kind) {
        case Kind::kNumbers:
          out.push_back(conform_number(value[i], field, element_path));
          break;
        case Kind::kIndices:
          out.push_back(conform_index(value[i], field.target, element_path));
          break;
        default:
          out.push_back(conform_object(value[i], field.fields, element_path));
          break;
      }
    }
    return out;
  }

  json conform_integer(const json& value, double low, double high, const std::string& path) const
  {
    const double x = value.is_number() ? value.get<double>() : std::nan("");
    if (!(x >= low && x <= high && x == std::floor(x))) {
      fail(path, "an integer within " + number_text(low) + "…" + number_text(high), value);
    }
    return static_cast<std::uint64_t>(x);
  }

  json conform_index(const json& value, std::string_view target, const std::string& path) const
  {
    const auto array = document_.find(target);
    if (array != document_.end() && !array->is_array()) {
      fail('/' + std::string(target), "an array", *array);
    }
    const std::size_t size = array != document_.end() ? array->size() : 0;
    const double x = value.is_number() ? value.get<double>() : -1;
    if (!(x >= 0 && x < static_cast<double>(size) && x == std::floor(x))) {
      fail(path, "an index into /" + std::string(target) + " (which has " + std::to_string(size) + ")", value);
    }
    return static_cast<std::uint64_t>(x);
  }

  json conform_number(const json& value, const Field& field, const std::string& path) const
  {
    const double x = value.is_number() ? value.get<double>() : std::nan("");
    if (field.clamps && std::isfinite(x) && !(x >= field.low && x <= field.high)) {
      const double used = std::clamp(x, field.low, field.high);
      warn(path, "a number within " + number_text(field.low) + "…" + number_text(field.high), value, number_text(used));
      return used;
    }
    if (!(std::isfinite(x) && x >= field.low && x <= field.high)) {
      const bool bounded = field.low > -kLargestFloat || field.high < kLargestFloat;
      fail(path,
           bounded ? "a number within " + number_text(field.low) + "…" + number_text(field.high) : "a finite number",
           value);
    }
    return x;
  }

  json conform_string(const json& value, const Field& field, const std::string& path) const
  {
    if (!value.is_string() && field.otherwise.empty()) {
      fail(path, "a string", value);
    }
    std::string_view labels = field.target;
    bool known = labels.empty();
    while (!known && !labels.empty()) {
      const std::size_t bar = std::min(labels.find('|'), labels.size());
      known = value.is_string() && labels.substr(0, bar) == value.get_ref<const std::string&>();
      labels.remove_prefix(std::min(bar + 1, labels.size()));
    }
    if (known) {
      return value;
    }
    const std::string expected = "one of " + std::string(field.target);
    if (field.otherwise.empty()) {
      fail(path, expected, value);
    }
    warn(path, expected, value, std::string(field.otherwise));
    return std::string(field.otherwise);
  }

  json conform_index_map(const json& value, const Field& field, const std::string& path) const
  {
    if (!value.is_object()) {
      fail(path, "an object", value);
    }
    json out = json::object();
    for (const auto& item : value.items()) {
      out[item.key()] = conform_index(item.value(), field.target, json_path_join(path, item.key()));
    }
    return out;
  }

  const json& document_;
  const std::string& file_;
  Warnings& warnings_;
};

/// Nodes must form trees. A node with two parents stays with the first. What a scene lists must be their roots: of
/// other nodes, those that stand in the scene anyhow are taken off the list, the others are roots there.
void conform_node_tree(json& document, const std::string& file, Warnings& warnings)
{
  const auto nodes = document.find("nodes");
  if (nodes == document.end()) {
    return;
  }
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> parent(nodes->size(), kNone);
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    const auto children = (*nodes)[i].find("children");
    if (children == (*nodes)[i].end()) continue;
    json kept = json::array();
    for (std::size_t j = 0; j < children->size(); ++j) {
      const auto child = (*children)[j].get<std::size_t>();
      if (parent[child] == kNone) {
        parent[child] = i;
        kept.push_back(child);
        continue;
      }
      warnings.add(file + ": /nodes/" + std::to_string(i) + "/children/" + std::to_string(j) +
                   ": expected a node without another parent, found node " + std::to_string(child) +
                   ", a child of node " + std::to_string(parent[child]) + ", where alone it counts");
    }
    *children = std::move(kept);
  }
  // With at most one parent each, a walk upwards either ends at a root or goes round. `mark` tells this walk from
  // earlier ones, so every node is visited once.
  std::vector<std::size_t> mark(nodes->size(), kNone);
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    std::size_t at = i;
    while (at != kNone && mark[at] == kNone) {
      mark[at] = i;
      at = parent[at];
    }
    if (at != kNone && mark[at] == i) {
      throw SceneError(file, "/nodes/" + std::to_string(at) + "/children", "a tree of nodes",
                       "a cycle through node " + std::to_string(at));
    }
  }
  const auto scenes = document.find("scenes");
  for (std::size_t s = 0; scenes != document.end() && s < scenes->size(); ++s) {
    const auto roots = (*scenes)[s].find("nodes");
    if (roots == (*scenes)[s].end()) continue;
    // 1: listed; 2: a descendant of such a node, or one already kept.
    std::vector<char> state(nodes->size(), 0);
    for (const json& root : *roots) state[root.get<std::size_t>()] = 1;
    json kept = json::array();
    for (std::size_t j = 0; j < roots->size(); ++j) {
      const auto root = (*roots)[j].get<std::size_t>();
      const auto warn = [&](const std::string& what) {
        warnings.add(file + ": /scenes/" + std::to_string(s) + "/nodes/" + std::to_string(j) + ": " + what);
      };
      if (state[root] == 2) {
        warn("node " + std::to_string(root) + " is listed twice, and counts once");
        continue;
      }
      std::size_t above = parent[root];
      while (above != kNone && state[above] == 0) above = parent[above];
      if (above != kNone) {
        warn("node " + std::to_string(root) + " is no root: it stands below node " + std::to_string(above) +
             ", and counts there alone");
        continue;
      }
      if (parent[root] != kNone) {
        warn("node " + std::to_string(root) + " is no root, but a child of node " + std::to_string(parent[root]) +
             ", which is not in the scene: it counts as a root, without that node's transform");
      }
      state[root] = 2;
      kept.push_back(root);
    }
    *roots = std::move(kept);
  }
}

/// Cross-references that tinygltf follows, or that only make sense together.
void check_references(json& document, const std::string& file)
{
  for (std::size_t m = 0; m < document["meshes"].size(); ++m) {
    const json& primitives = document["meshes"][m]["primitives"];
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const auto i = primitives[p].find("indices");
      if (i != primitives[p].end() && !document["accessors"][i->get<std::size_t>()].contains("bufferView")) {
        throw SceneError(file, "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p) + "/indices",
                         "an accessor with a bufferView", "one without");
      }
    }
  }
  for (std::size_t c = 0; c < document["cameras"].size(); ++c) {
    const json& camera = document["cameras"][c];
    const std::string& type = camera["type"].get_ref<const std::string&>();
    if (!camera.contains(type)) {
      throw SceneError(file, "/cameras/" + std::to_string(c) + "/" + type, "the camera's properties", "nothing");
    }
  }
  for (std::size_t a = 0; a < document["animations"].size(); ++a) {
    json& animation = document["animations"][a];
    for (std::size_t c = 0; c < animation["channels"].size(); ++c) {
      json& channel = animation["channels"][c];
      const std::size_t num_samplers = animation["samplers"].size();
      if (channel["sampler"].get<std::size_t>() >= num_samplers) {
        throw SceneError(file, "/animations/" + std::to_string(a) + "/channels/" + std::to_string(c) + "/sampler",
                         "an index below " + std::to_string(num_samplers), channel["sampler"].dump());
      }
      // A channel without a node drives something that an extension names; tinygltf would drop it and so shift the
      // channels after it.
      if (!channel["target"].contains("node")) {
        channel["target"]["node"] = -1;
      }
    }
  }
}

/// Values that are numbers in the file but names in meaning.
void check_enumerations(const json& document, const std::string& file)
{
  const auto require = [&](const json& value, std::initializer_list<int> allowed, const std::string& path,
                           const std::string& expected) {
    if (std::find(allowed.begin(), allowed.end(), value.get<int>()) == allowed.end()) {
      throw SceneError(file, path, expected, value.dump());
    }
  };
  const auto check = [&](const char* array, const char* name, std::initializer_list<int> allowed,
                         const std::string& expected) {
    const auto elements = document.find(array);
    for (std::size_t i = 0; elements != document.end() && i < elements->size(); ++i) {
      const auto value = (*elements)[i].find(name);
      if (value != (*elements)[i].end()) {
        require(*value, allowed, '/' + std::string(array) + '/' + std::to_string(i) + '/' + name, expected);
      }
    }
  };
  check("accessors", "componentType", {5120, 5121, 5122, 5123, 5125, 5126}, "5120…5123, 5125 or 5126");
  check("samplers", "wrapS", {10497, 33071, 33648}, "10497, 33071 or 33648");
  check("samplers", "wrapT", {10497, 33071, 33648}, "10497, 33071 or 33648");
  const auto views = document.find("bufferViews");
  for (std::size_t i = 0; views != document.end() && i < views->size(); ++i) {
    const auto stride = (*views)[i].find("byteStride");
    if (stride != (*views)[i].end() && stride->get<int>() % 4 != 0) {
      throw SceneError(file, "/bufferViews/" + std::to_string(i) + "/byteStride", "a multiple of 4", stride->dump());
    }
  }
}

/// First of all, since a glTF of version 1 differs in everything.
void check_version(const json& document, const std::string& file)
{
  const auto asset = document.find("asset");
  const bool has_asset = asset != document.end() && asset->is_object();
  const auto version = has_asset ? asset->find("version") : document.end();
  const bool has_version = has_asset && version != asset->end() && version->is_string();
  const std::string text = has_version ? version->get<std::string>() : std::string();
  const auto nodes = document.find("nodes");
  // Its arrays were objects by name; early files name no version.
  const bool is_1 = has_version ? text.rfind("1.", 0) == 0 : nodes != document.end() && nodes->is_object();
  if (is_1) {
    throw SceneError(file, "/asset/version", "glTF 2.0",
                     "glTF 1.0, which another program (Blender up to 2.79, glTF-Pipeline up to 3) has to convert");
  }
  if (has_version && text.rfind("2.", 0) != 0) {
    throw SceneError(file, "/asset/version", "\"2.0\"", '"' + text + '"');
  }
}

/// What a text of JSON will be, by its brackets, colons and commas outside strings.
struct JsonExtent {
  int deepest = 0;  ///< nesting; the parser and the destructor of a document are iterative, but printing a value is not
  std::uint64_t values = 1, members = 0;  ///< at most
};

JsonExtent json_extent(std::string_view text)
{
  JsonExtent extent;
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_string = false;
      }
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      extent.deepest = std::max(extent.deepest, ++depth);
      ++extent.values;
    } else if (c == ']' || c == '}') {
      --depth;
    } else if (c == ',') {
      ++extent.values;
    } else if (c == ':') {
      ++extent.members;
    }
  }
  return extent;
}

/// Names of all extensions that a value and what is in it have; `extras` are nobody's business.
void collect_extensions(const json& value, std::set<std::string>& names)
{
  if (value.is_object()) {
    for (const auto& item : value.items()) {
      if (item.key() == "extras") continue;
      if (item.key() == "extensions" && item.value().is_object()) {
        for (const auto& extension : item.value().items()) names.insert(extension.key());
      }
      collect_extensions(item.value(), names);
    }
  } else if (value.is_array()) {
    for (const json& element : value) collect_extensions(element, names);
  }
}

/// What another program can do about an extension that is not read; with a comma before it, or empty.
std::string conversion_of(const std::string& extension)
{
  struct Conversion {
    std::string_view extension, text;
  };
  constexpr Conversion kConversions[] = {
      {"KHR_draco_mesh_compression", "compressed meshes: `gltf-transform copy IN OUT` (glTF-Transform), or an import into "
                                     "Blender and an export without compression, writes them plain"},
      {"EXT_meshopt_compression", "compressed buffers: `gltf-transform copy IN OUT` (glTF-Transform) or `gltfpack` without "
                                  "-c writes them plain"},
      {"KHR_meshopt_compression", "compressed buffers: `gltf-transform copy IN OUT` (glTF-Transform) writes them plain"},
      {"KHR_texture_basisu", "KTX2 textures: `ktx extract` (KTX-Software) makes PNG of each, which the images' uri then "
                             "names"},
      {"EXT_texture_webp", "WebP textures: `gltf-transform png IN OUT` (glTF-Transform) makes PNG of them"},
      {"EXT_texture_avif", "AVIF textures: `gltf-transform png IN OUT` (glTF-Transform) makes PNG of them"},
      {"MSFT_texture_dds", "DDS textures: their images' own source, PNG or JPEG, is read once the file does not require "
                           "the extension"},
      {"KHR_materials_pbrSpecularGlossiness", "materials of specular colour and glossiness: `gltf-transform metalrough IN "
                                              "OUT` (glTF-Transform) makes metal and roughness of them"},
      {"KHR_techniques_webgl", "materials of WebGL shaders, which no program converts: export the scene again"},
  };
  const auto* found = std::find_if(std::begin(kConversions), std::end(kConversions),
                                   [&](const Conversion& known) { return known.extension == extension; });
  return found != std::end(kConversions) ? ", " + std::string(found->text)
                                         : ", which another program would have to take out";
}

bool is_supported(const std::string& extension)
{
  return std::find(std::begin(kSupportedExtensions), std::end(kSupportedExtensions), extension) !=
         std::end(kSupportedExtensions);
}

/// Extensions that are there although extensionsUsed does not list them.
void warn_undeclared(const json& document, const std::string& file, Warnings& warnings)
{
  std::set<std::string> names;
  collect_extensions(document, names);
  if (const auto used = document.find("extensionsUsed"); used != document.end()) {
    for (const json& name : *used) names.erase(name.get<std::string>());
  }
  for (const std::string& name : names) {
    warnings.add(file + ": /extensionsUsed: does not list " + name + ", which the file has; it is " +
                 (is_supported(name) ? "read all the same" : "not read"));
  }
}

}  // namespace

json validation_parse(std::string_view text, const std::string& file)
{
  if (const std::string_view kind = file_kind(text); !kind.empty()) {
    throw SceneError(file, "", "glTF 2.0 (.gltf, .glb)", std::string(kind));
  }
  constexpr int kDeepest = 100;
  const JsonExtent extent = json_extent(text);
  if (extent.deepest > kDeepest) {
    throw SceneError(file, "", "JSON nested at most " + std::to_string(kDeepest) + " levels deep",
                     std::to_string(extent.deepest) + " levels");
  }
  // The text, its conforming copy and tinygltf's are in memory together: a file of 2^20 references takes 240 bytes a value and
  // member, one of plain numbers 60.
  constexpr std::uint64_t kValueBytes = 48, kMemberBytes = 128;
  memory_require(extent.values * kValueBytes + extent.members * kMemberBytes, file + ": JSON");
  json document;
  try {
    document = json::parse(text);
  } catch (const json::exception& e) {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: …": the position and reason are for the user.
    const std::string what = e.what();
    const std::size_t end = what.find("] ");
    throw SceneError(file, "", "JSON", end == std::string::npos ? what : what.substr(end + 2));
  }
  if (!document.is_object()) {
    throw SceneError(file, "/", "an object", json_describe(document));
  }
  return document;
}

namespace {

/// Removes members that are null, but what is in `extras`.
/// @param path   of the value
/// @param first  gets the path of the first
/// @return how many there were
std::size_t drop_nulls(json& value, const std::string& path, std::string& first)
{
  std::size_t count = 0;
  if (value.is_object()) {
    for (auto member = value.begin(); member != value.end();) {
      if (member.key() == "extras") {
        ++member;
        continue;
      }
      const bool is_null = member->is_null();
      // Paths cost time, and few files have any.
      if (is_null && count == 0 && first.empty()) first = json_path_join(path, member.key());
      if (is_null) {
        member = value.erase(member);
        ++count;
        continue;
      }
      if (member->is_structured()) count += drop_nulls(*member, json_path_join(path, member.key()), first);
      ++member;
    }
  } else if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (value[i].is_structured()) count += drop_nulls(value[i], json_path_join(path, i), first);
    }
  }
  return count;
}

}  // namespace

void validation_drop_nulls(json& document, const std::string& file, Warnings& warnings)
{
  std::string first;
  const std::size_t count = drop_nulls(document, "", first);
  if (count == 0) return;
  warnings.add(file + ": " + first + ": expected a value, found null, which counts as nothing" +
               (count > 1 ? " (" + std::to_string(count) + " in all)" : ""));
}

json validation_conform(const json& document, const std::string& file, Warnings& warnings)
{
  check_version(document, file);
  json out = Conformer(document, file, warnings).conform_object(document, kDocument, "");
  check_enumerations(out, file);
  conform_node_tree(out, file, warnings);
  for (const char* array : {"meshes", "cameras", "animations", "accessors"}) {
    if (!out.contains(array)) {
      out[array] = json::array();
    }
  }
  check_references(out, file);
  out.erase("buffers");
  out.erase("images");
  return out;
}

void validation_check_support(const json& document, const std::string& file, Warnings& warnings)
{
  const auto for_each_unknown = [&](const char* list, const auto& act) {
    const auto names = document.find(list);
    if (names == document.end()) {
      return;
    }
    const std::string path = '/' + std::string(list);
    if (!names->is_array()) {
      throw SceneError(file, path, "an array of strings", json_describe(*names));
    }
    for (std::size_t i = 0; i < names->size(); ++i) {
      const json& name = (*names)[i];
      if (!name.is_string()) {
        throw SceneError(file, json_path_join(path, i), "a string", json_describe(name));
      }
      const std::string& text = name.get_ref<const std::string&>();
      if (!is_supported(text)) {
        act(text, json_path_join(path, i));
      }
    }
  };
  for_each_unknown("extensionsRequired", [&](const std::string& name, const std::string& path) {
    throw SceneError(file, path, "an extension that relief reads", '"' + name + '"' + conversion_of(name));
  });
  for_each_unknown("extensionsUsed", [&](const std::string& name, const std::string&) {
    warnings.add(file + ": extension " + name + " is not read");
  });
  warn_undeclared(document, file, warnings);
  const auto skins = document.find("skins");
  if (skins != document.end() && skins->is_array() && !skins->empty()) {
    warnings.add(file + ": /skins: skins are not read; meshes keep their rest pose");
  }
}

}  // namespace relief
