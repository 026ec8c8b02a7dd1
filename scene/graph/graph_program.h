// A compiled value graph, which owns what a GraphProgramView looks at.
#pragma once

#include <memory>
#include <vector>

#include "kernel/graph/graph_op.h"
#include "kernel/graph/graph_program.h"
#include "kernel/graph/voxel_view.h"
#include "kernel/volume/volume_closure.h"

namespace relief {

struct Voxels;  // scene/voxels.h

struct GraphProgram {
  std::vector<std::uint16_t> code;
  std::vector<float> constants, tables;
  std::vector<VoxelView> voxels;  ///< of these, which other programs may share
  std::vector<std::shared_ptr<const Voxels>> voxel_owners;
  std::vector<GraphInput> inputs;
  std::uint16_t outputs[kNumGraphOutputs][3] = {};
  std::uint32_t given = 0;  ///< bit GraphOutput
  std::vector<std::uint16_t> results;
  std::vector<float> result_values;  ///< this and the next two: see GraphProgramView
  std::vector<std::uint16_t> varying_before, varying;
  std::vector<SurfaceClosureSpec> closures;
  std::uint16_t surface_normal = kNoGraphOperand;  ///< see GraphProgramView
  int num_registers = 0;
  std::vector<std::uint16_t> attributes;  ///< places in Scene::attribute_names that it reads, sorted

  GraphProgramView view() const;
  std::size_t bytes() const;
};

/// What gives a medium.
struct VolumeProgram {
  GraphProgram program;
  std::vector<VolumeClosureSpec> closures;  ///< none: the medium is even
};

/// The textures that a program reads, each as often as it does.
std::vector<int> graph_textures(const GraphProgram& program);

/// Whether an operation depends on the scene's textures or voxels.
bool graph_op_reads_images(GraphOp op);

/// A light that graphs of surroundings have in so small a part of them that it is to be looked for.
struct GraphSun {
  Vec3f towards;  ///< unit, Z up
  float radius;   ///< angle
};

/// Runs a program that reads no image, where scenes are made; what renders has its own for every instruction set.
/// @param textures   not read
/// @param registers  the program's inputs are filled
void graph_program_run(const GraphProgramView& program, const TextureView* textures, GraphRegisters& registers);

}  // namespace relief
