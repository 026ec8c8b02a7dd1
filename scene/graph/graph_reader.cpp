#include "scene/graph/graph_reader.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "scene/gltf_mesh.h"
#include "scene/graph/closure_reader.h"
#include "scene/graph/graph_nodes.h"
#include "scene/graph/graph_vectors.h"
#include "scene/khronos_extensions.h"

namespace relief {
namespace {

constexpr std::size_t kMostNodes = 65536;

/// Voxels along a side of images of slices.
constexpr double kMostSlices = 65536;

/// Every point looks its attributes up among those of its mesh.
constexpr std::size_t kMostAttributes = 1024;

/// Where a value comes from.
struct Reference {
  std::size_t node = 0;
  std::string output;
};

/// One node as the file has it.
struct Source {
  const GraphNodeKind* kind = nullptr;
  JsonReader reader;
  std::vector<std::pair<std::string_view, Reference>> references;
  std::vector<std::pair<std::string_view, GraphValue>> literals;
};

struct Reader {
  const GltfDocument& document;
  std::string file, path;  ///< of the graph
  TextureTable& textures;
  std::vector<std::string>& attribute_names;
  Warnings& warnings;
  GraphBuilder build;
  std::vector<Source> sources;
  std::vector<std::map<std::string_view, GraphValue>> values;  ///< outputs of each node
  std::set<std::uint16_t> attributes;                          ///< places of the names that are read
  std::vector<GraphSun> suns = {};

  GraphValue literal(const JsonReader& parent, std::string_view name, GraphType type);
  Reference reference(const JsonReader& parent, std::string_view name, std::size_t num_nodes) const;
  void read_node(std::size_t index, const nlohmann::json& json, std::size_t num_nodes);
  std::vector<std::size_t> order() const;
  GraphValue look_up(const JsonReader& parent, std::string_view name, const Reference& reference) const;
  GraphValue input(const JsonReader& parent, std::string_view name, GraphType type);
  std::uint16_t attribute(const JsonReader& node, const std::string& name);
  void lower(std::size_t index);
  void read_nodes(const JsonReader& graph);
  void read_outputs(const JsonReader& graph);
};

/// A number, or three of them; numbers do for vectors and colours.
GraphValue Reader::literal(const JsonReader& parent, std::string_view name, GraphType type)
{
  const nlohmann::json& json = parent.raw(name);
  GraphValue value{type, {}};
  if (json.is_number()) {
    value.v.fill(build.constant(parent.number_f(name, 0)));
    return value;
  }
  if (type == GraphType::kNumber) parent.fail(name, "a number, or {\"node\": …}", json_describe(json));
  if (!json.is_array()) parent.fail(name, "three numbers, or {\"node\": …}", json_describe(json));
  const std::vector<double> numbers = parent.numbers(name, 3, 3, -1e30, 1e30);
  for (std::size_t c = 0; c < 3; ++c) value.v[c] = build.constant(static_cast<float>(numbers[c]));
  return value;
}

Reference Reader::reference(const JsonReader& parent, std::string_view name, std::size_t num_nodes) const
{
  const JsonReader r = parent.object(name);
  const int node = r.index("node", num_nodes, "nodes");
  if (node < 0) r.fail("node", "the index of a node");
  Reference out{static_cast<std::size_t>(node), r.string("output", "")};
  r.warn_unread(warnings);
  return out;
}

void Reader::read_node(std::size_t index, const nlohmann::json& json, std::size_t num_nodes)
{
  const std::string node_path = json_path_join(json_path_join(path, "nodes"), index);
  Source source{nullptr, JsonReader(json, file, node_path), {}, {}};
  const std::string type = source.reader.string("type", "");
  source.kind = graph_node_kind(type);
  if (source.kind == nullptr) source.reader.fail("type", "the type of a node (docs/graphs.md)", '"' + type + '"');
  if (source.reader.has("inputs")) {
    const JsonReader inputs = source.reader.object("inputs");
    for (const GraphSocket& socket : source.kind->inputs) {
      if (!inputs.has(socket.name)) continue;
      if (inputs.raw(socket.name).is_object()) {
        source.references.emplace_back(socket.name, reference(inputs, socket.name, num_nodes));
      } else {
        source.literals.emplace_back(socket.name, literal(inputs, socket.name, socket.type));
      }
    }
    inputs.warn_unread(warnings);
  }
  sources.push_back(std::move(source));
}

/// Nodes, each after those it refers to.
std::vector<std::size_t> Reader::order() const
{
  std::vector<std::vector<std::size_t>> users(sources.size());
  std::vector<std::size_t> waits_for(sources.size(), 0), ready;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    waits_for[i] = sources[i].references.size();
    for (const auto& [name, from] : sources[i].references) users[from.node].push_back(i);
    if (waits_for[i] == 0) ready.push_back(i);
  }
  for (std::size_t done = 0; done < ready.size(); ++done) {
    for (const std::size_t user : users[ready[done]]) {
      if (--waits_for[user] == 0) ready.push_back(user);
    }
  }
  if (ready.size() < sources.size()) {
    const auto stuck = std::find_if(waits_for.begin(), waits_for.end(), [](std::size_t n) { return n > 0; });
    sources[static_cast<std::size_t>(stuck - waits_for.begin())].reader.fail(
        "inputs", "nodes without a cycle", "one that leads back to this node, or to one that it needs");
  }
  return ready;
}

GraphValue Reader::look_up(const JsonReader& parent, std::string_view name, const Reference& from) const
{
  const auto& outputs = values[from.node];
  if (from.output.empty() && outputs.size() == 1) return outputs.begin()->second;
  const auto it = outputs.find(from.output);
  if (it == outputs.end()) {
    std::string known;
    for (const auto& [output, value] : outputs) known += (known.empty() ? "\"" : ", \"") + std::string(output) + '"';
    parent.fail(name, "an output of node " + std::to_string(from.node) + " (" + known + ')',
                from.output.empty() ? "none named" : '"' + from.output + '"');
  }
  return it->second;
}

/// An input outside of the graph's nodes; index −1 where it is not given.
GraphValue Reader::input(const JsonReader& parent, std::string_view name, GraphType type)
{
  if (!parent.has(name)) return {type, {}};
  if (!parent.raw(name).is_object()) return literal(parent, name, type);
  return graph_convert(build, look_up(parent, name, reference(parent, name, sources.size())), type);
}

/// Place of an attribute's name.
std::uint16_t Reader::attribute(const JsonReader& node, const std::string& name)
{
  const auto it = std::find(attribute_names.begin(), attribute_names.end(), name);
  const auto place = static_cast<std::size_t>(it - attribute_names.begin());
  if (it == attribute_names.end()) {
    if (place == kMostAttributes) node.fail("name", "one of the scene's first 1,024 names of attributes");
    attribute_names.push_back(name);
  }
  attributes.insert(static_cast<std::uint16_t>(place));
  return static_cast<std::uint16_t>(place);
}

void Reader::lower(std::size_t index)
{
  const Source& source = sources[index];
  std::map<std::string_view, GraphValue> inputs;
  for (const GraphSocket& socket : source.kind->inputs) {
    if (socket.is_normal) {
      inputs[socket.name] = {
          socket.type, quantities(build, GraphQuantity::normal_x, GraphQuantity::normal_y, GraphQuantity::normal_z)};
      continue;
    }
    inputs[socket.name] = {
        socket.type,
        {build.constant(socket.value[0]), build.constant(socket.value[1]), build.constant(socket.value[2])}};
  }
  std::set<std::string_view> given;
  for (const auto& [name, value] : source.literals) {
    inputs[name] = value;
    given.insert(name);
  }
  for (const auto& [name, from] : source.references) {
    given.insert(name);
    inputs[name] = graph_convert(build, look_up(source.reader.object("inputs"), name, from), inputs[name].type);
  }
  const bool is_straight = source.reader.has("alpha") && source.reader.string("alpha", "") == "straight";
  const bool is_divided = source.reader.has("unassociate") && source.reader.boolean("unassociate", false);
  const std::function<int(const JsonReader&)> texture = [=, this](const JsonReader& r) {
    static constexpr std::string_view kSpaces[] = {"srgb", "linear", "encoded-srgb"};
    static constexpr TextureColor kStored[] = {TextureColor::kSrgb, TextureColor::kLinear, TextureColor::kEncodedSrgb};
    static constexpr TextureColor kAssociated[] = {TextureColor::kSrgbAssociated, TextureColor::kLinearAssociated,
                                                   TextureColor::kEncodedSrgbAssociated};
    static constexpr TextureColor kDivided[] = {TextureColor::kSrgbDivided, TextureColor::kLinear,
                                                TextureColor::kEncodedSrgbDivided};
    const auto space = static_cast<std::size_t>(r.choice("colorSpace", kSpaces, 0));
    const TextureColor color = is_divided ? kDivided[space] : is_straight ? kAssociated[space] : kStored[space];
    const TextureRef ref = khronos_texture_ref(document, r, "texture", color, textures, warnings);
    if (ref.texture_index < 0) r.fail("texture", "{\"index\": …}");
    // Programs have 16 bits for it.
    if (ref.texture_index > 0xffff) r.fail("texture", "one of the scene's first 65,536 textures");
    return ref.texture_index;
  };
  const std::function<const IesProfile&(const JsonReader&)> ies = [this](const JsonReader& r) -> const IesProfile& {
    if (!r.has("uri")) r.fail("uri", "the path of an IES file");
    return textures.add_ies(document, r.string("uri", ""), json_path_join(r.path(), "uri"));
  };
  const std::function<std::uint16_t(const JsonReader&, const std::string&)> named =
      [this](const JsonReader& r, const std::string& name) { return attribute(r, name); };
  const std::function<std::shared_ptr<const Voxels>(const JsonReader&)> voxels = [this](const JsonReader& r) {
    if (!r.has("uri")) r.fail("uri", "the path of an OpenVDB file, or of an image of slices");
    const bool is_image = r.has("size");
    if (is_image == r.has("grid")) r.fail("", "either grid or size", is_image ? "both" : "neither");
    const std::string grid = r.string("grid", "");
    if (!is_image && grid.empty()) r.fail("grid", "the name of a grid");
    std::array<int, 3> size{};
    const std::vector<double> numbers = r.numbers("size", 3, 3, 1, kMostSlices);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      size[i] = static_cast<int>(numbers[i]);
      if (numbers[i] != size[i]) r.fail("size", "three whole numbers");
    }
    return textures.add_voxels(document, r.string("uri", ""), grid, size, json_path_join(r.path(), "uri"));
  };
  GraphNode node{build, source.reader, inputs, values[index], given, texture, ies, voxels, named, suns};
  source.kind->lower(node);
  source.reader.warn_unread(warnings);
}

void Reader::read_outputs(const JsonReader& graph)
{
  struct Named {
    std::string_view name;
    GraphType type;
  };
  static constexpr Named kOutputs[] = {
#define X(name, json, components) {json, (components) == 1 ? GraphType::kNumber : GraphType::kColor},
#include "kernel/graph/graph_outputs.inc"
#undef X
  };
  if (!graph.has("outputs")) graph.fail("outputs", "an object");
  const JsonReader outputs = graph.object("outputs");
  for (int i = 0; i < kNumGraphOutputs; ++i) {
    const auto& [name, type] = kOutputs[i];
    if (!outputs.has(name)) continue;
    if (!outputs.raw(name).is_object()) outputs.fail(name, "{\"node\": …}", json_describe(outputs.raw(name)));
    const GraphValue value = look_up(outputs, name, reference(outputs, name, sources.size()));
    build.set_output(static_cast<GraphOutput>(i), graph_convert(build, value, type).v);
  }
  outputs.warn_unread(warnings);
}

void Reader::read_nodes(const JsonReader& graph)
{
  if (!graph.has("nodes") || !graph.raw("nodes").is_array()) graph.fail("nodes", "an array");
  const nlohmann::json& nodes = graph.raw("nodes");
  if (nodes.size() > kMostNodes) {
    graph.fail("nodes", "at most " + std::to_string(kMostNodes), std::to_string(nodes.size()));
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) read_node(i, nodes[i], nodes.size());
  values.resize(nodes.size());
  for (const std::size_t node : order()) lower(node);
}

/// A graph with one output, whose numbers become the program's results.
/// @param suns  gets the small lights that it has
GraphProgram read_output(const GltfDocument& document,
                         const JsonReader& graph,
                         const char* name,
                         GraphType type,
                         TextureTable& textures,
                         std::vector<std::string>& attribute_names,
                         std::vector<GraphSun>& suns,
                         Warnings& warnings)
{
  // Neither directions nor texels have attributes: what a graph reads of one is 0.
  Reader r{document, graph.file(), graph.path(), textures, attribute_names, warnings, {}, {}, {}, {}};
  try {
    r.read_nodes(graph);
    if (!graph.has("outputs")) graph.fail("outputs", "an object");
    const JsonReader outputs = graph.object("outputs");
    const GraphValue value = r.input(outputs, name, type);
    if (value.v[0].index < 0) outputs.fail(name, "{\"node\": …}");
    outputs.warn_unread(warnings);
    for (std::size_t c = 0; c < (type == GraphType::kNumber ? 1u : 3u); ++c) r.build.add_result(value.v[c]);
    suns = r.suns;
    GraphProgram program = r.build.compile();
    program.attributes.assign(r.attributes.begin(), r.attributes.end());
    return program;
  } catch (const GraphTooLarge& error) {
    graph.fail("", error.what(), "one that needs more");
  }
}

/// What a glTF texture has at a point of the mesh.
/// @param at  names it in messages
GraphVector texture_vector(GraphBuilder& b, const TextureRef& map, const JsonReader& at)
{
  // Programs have 16 bits for it.
  if (map.texture_index > 0xffff) at.fail("index", "one of the scene's first 65,536 textures");
  const bool is_first = map.uv_set == 0;
  const GraphScalar u = b.quantity(is_first ? GraphQuantity::uv0_u : GraphQuantity::uv1_u);
  const GraphScalar up = b.quantity(is_first ? GraphQuantity::uv0_v : GraphQuantity::uv1_v);
  const GraphScalar one = b.constant(1), v = b(GraphOp::subtract, {one, up});
  const auto row = [&](float of_u, float of_v, float more) {
    return sum3(b, scaled(b, u, of_u), scaled(b, v, of_v), b.constant(more));
  };
  // Texture coordinates of graphs point up.
  const GraphScalar inputs[] = {row(map.m00, map.m01, map.m02),
                                b(GraphOp::subtract, {one, row(map.m10, map.m11, map.m12)}), b.constant(0)};
  const std::uint16_t immediates[] = {static_cast<std::uint16_t>(map.texture_index), 0};
  const std::vector<GraphScalar> rgba = b.apply(GraphOp::image, inputs, immediates);
  return {rgba[0], rgba[1], rgba[2]};
}

/// The same where the graph's object has nothing else, and suns are of no interest.
GraphProgram read_whole(const GltfDocument& document,
                        const JsonReader& graph,
                        const char* name,
                        GraphType type,
                        TextureTable& textures,
                        std::vector<std::string>& attribute_names,
                        Warnings& warnings)
{
  std::vector<GraphSun> suns;
  GraphProgram program = read_output(document, graph, name, type, textures, attribute_names, suns, warnings);
  graph.warn_unread(warnings);
  return program;
}

}  // namespace

GraphPrograms graph_read(const GltfDocument& document,
                         const JsonReader* graph,
                         const JsonReader* surface,
                         const JsonReader* volume,
                         TextureTable& textures,
                         std::vector<std::string>& attribute_names,
                         Warnings& warnings)
{
  const JsonReader& reader = graph != nullptr ? *graph : surface != nullptr ? *surface : *volume;
  Reader r{document, reader.file(), reader.path(), textures, attribute_names, warnings, {}, {}, {}, {}};
  GraphPrograms programs;
  try {
    const auto input = [&r](const JsonReader& parent, std::string_view name, GraphType type) {
      return r.input(parent, name, type);
    };
    if (graph != nullptr) r.read_nodes(*graph);
    if (volume != nullptr) {
      const GraphBuilder nodes = r.build;
      programs.volume.emplace();
      programs.volume->closures = volume_closures_read(*volume, input, r.build, warnings);
      programs.volume->program = r.build.compile();
      programs.volume->program.attributes.assign(r.attributes.begin(), r.attributes.end());
      r.build = nodes;
    }
    bool has_outputs = false;
    if (graph != nullptr) {
      has_outputs = (surface == nullptr && volume == nullptr) || graph->has("outputs");
      if (has_outputs) r.read_outputs(*graph);
      graph->warn_unread(warnings);
    }
    if (surface == nullptr && !has_outputs) return programs;
    std::vector<SurfaceClosureSpec> closures;
    std::uint16_t surface_normal = kNoGraphOperand;
    if (surface != nullptr) {
      const GraphValue normal = input(*surface, "normal", GraphType::kVector);
      closures = closures_read(*surface, input, r.build, warnings);
      if (normal.v[0].index >= 0) {
        surface_normal = r.build.add_result(normal.v[0]);
        r.build.add_result(normal.v[1]);
        r.build.add_result(normal.v[2]);
      }
    }
    programs.surface = r.build.compile();
    programs.surface->closures = closures;
    programs.surface->surface_normal = surface_normal;
    programs.surface->attributes.assign(r.attributes.begin(), r.attributes.end());
    const auto alone = [&](ClosureKind kind, int num_numbers) {
      std::optional<GraphProgram> program;
      std::vector<SurfaceClosureSpec> kept = closures;
      std::erase_if(kept, [kind](const SurfaceClosureSpec& c) { return c.kind != kind; });
      if (kept.empty()) return program;
      GraphBuilder build = r.build;
      build.keep_results(kept, 1 + num_numbers);
      program = build.compile();
      program->closures = kept;
      return program;
    };
    programs.transparency = alone(ClosureKind::transparent, sizeof(TransparentInputs) / sizeof(float));
    programs.emission = alone(ClosureKind::emission, sizeof(EmissionInputs) / sizeof(float));
    return programs;
  } catch (const GraphTooLarge& error) {
    reader.fail("", error.what(), "one that needs more");
  }
}

VolumeProgram volume_read(const GltfDocument& document,
                          const JsonReader& volume,
                          TextureTable& textures,
                          Warnings& warnings)
{
  std::vector<std::string> attribute_names;  // there are none
  const JsonReader* graph = volume.has("nodes") ? &volume : nullptr;
  return *graph_read(document, graph, nullptr, &volume, textures, attribute_names, warnings).volume;
}

GraphProgram graph_read_color(const GltfDocument& document,
                              const JsonReader& graph,
                              TextureTable& textures,
                              std::vector<GraphSun>& suns,
                              Warnings& warnings)
{
  std::vector<std::string> attribute_names;  // there are none
  return read_output(document, graph, "color", GraphType::kColor, textures, attribute_names, suns, warnings);
}

GraphProgram graph_read_lamp(const GltfDocument& document,
                             const JsonReader& graph,
                             TextureTable& textures,
                             Warnings& warnings)
{
  std::vector<std::string> attribute_names;  // there are none
  return read_whole(document, graph, "emission", GraphType::kColor, textures, attribute_names, warnings);
}

GraphProgram height_graph_read(const GltfDocument& document,
                               const JsonReader& graph,
                               TextureTable& textures,
                               std::vector<std::string>& attribute_names,
                               Warnings& warnings)
{
  return read_whole(document, graph, "height", GraphType::kNumber, textures, attribute_names, warnings);
}

GraphProgram vector_graph_read(const GltfDocument& document,
                               const JsonReader& displacement,
                               TextureTable& textures,
                               std::vector<std::string>& attribute_names,
                               Warnings& warnings)
{
  const bool has_texture = displacement.has("vectorTexture");
  const JsonReader source = displacement.object(has_texture ? "vectorTexture" : "vectorGraph");
  Reader r{document, source.file(), source.path(), textures, attribute_names, warnings, {}, {}, {}, {}};
  GraphBuilder& b = r.build;
  try {
    GraphVector v;
    int uv_set = 0;
    if (has_texture) {
      const TextureRef map =
          khronos_texture_ref(document, displacement, "vectorTexture", TextureColor::kLinear, textures, warnings);
      uv_set = map.uv_set;
      v = texture_vector(b, map, source);
      textures.use_for_vectors(map.texture_index);
    } else {
      r.read_nodes(source);
      if (!source.has("outputs")) source.fail("outputs", "an object");
      const JsonReader outputs = source.object("outputs");
      const bool is_given = outputs.has("vector") && outputs.raw("vector").is_object();
      if (!is_given) outputs.fail("vector", "{\"node\": …}");
      const GraphValue value = r.look_up(outputs, "vector", r.reference(outputs, "vector", r.sources.size()));
      if (value.type == GraphType::kNumber) outputs.fail("vector", "a vector or a colour", "a number");
      outputs.warn_unread(warnings);
      v = value.v;
      uv_set = static_cast<int>(source.integer("texCoord", 0, 0, 1));
      source.warn_unread(warnings);
    }
    const GraphVector midlevel = splat(b.constant(displacement.number_f("midlevel", 0)));
    const GraphVector scale = splat(b.constant(displacement.number_f("scale", 1)));
    const auto space = static_cast<VectorSpace>(
        displacement.choice("space", kVectorSpaceLabels, static_cast<int>(VectorSpace::kObject)));
    GraphVector tangent;
    GraphScalar handedness;
    if (space == VectorSpace::kTangent) {
      const std::uint16_t place = r.attribute(source, tangent_attribute_name(uv_set));
      tangent = {b.quantity(GraphQuantity::attribute_x, place), b.quantity(GraphQuantity::attribute_y, place),
                 b.quantity(GraphQuantity::attribute_z, place)};
      handedness = b.quantity(GraphQuantity::attribute_alpha, place);
    }
    v = each(b, GraphOp::multiply, each(b, GraphOp::subtract, v, midlevel), scale);
    for (const GraphScalar a : vector_in_object(b, space, v, tangent, handedness)) b.add_result(a);
    GraphProgram program = b.compile();
    program.attributes.assign(r.attributes.begin(), r.attributes.end());
    return program;
  } catch (const GraphTooLarge& error) {
    source.fail("", error.what(), "one that needs more");
  }
}

}  // namespace relief
