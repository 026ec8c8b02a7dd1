// Collects what materials, displacements and the environment ask of textures; equal requests share one index.
#pragma once

#include <array>
#include <map>
#include <tuple>
#include <vector>

#include "scene/gltf_document.h"
#include "scene/graph/ies_file.h"
#include "scene/texture_store.h"
#include "scene/voxels.h"

namespace relief {

/// Sampler of a texture request.
struct TextureSampling {
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  TexelFilter filter = TexelFilter::kLinear;
};

/// Each function returns the index that the texture will have in the TextureStore made of `take()`. Where someone hears of
/// faults, they are none of the errors below: what cannot be had is missing.
class TextureTable {
 public:
  /// @param faults  hears of what cannot be had, from here and from those who read the requests; outlives them. Null: errors
  explicit TextureTable(TextureFaults* faults = nullptr) : faults_(faults) {}

  /// Who hears of what cannot be had; null: nobody.
  TextureFaults* faults() const { return faults_; }

  /// A glTF texture: image and sampler.
  /// @param texture_index  valid (validated core)
  /// @error SceneError: the texture has no source; see add_image
  int add_texture(const GltfDocument& document, int texture_index, TextureColor color);

  /// @param image_index  below the number of images
  /// @error SceneError: neither or both of uri and bufferView, missing file, bad data URI, bad buffer view
  int add_image(const GltfDocument& document, int image_index, TextureColor color, TextureSampling sampling);

  /// A path beside the file.
  /// @error SceneError at `json_path` if there is no such file
  int add_file(const GltfDocument& document,
               const std::string& uri,
               const std::string& json_path,
               TextureColor color,
               TextureSampling sampling);

  /// A file that the user names.
  /// @param option  that names it, for messages
  int add_path(const std::filesystem::path& file,
               const std::string& option,
               TextureColor color,
               TextureSampling sampling);

  /// Says that a value graph of heights reads a texture.
  void use_for_heights(int texture) { requests_[static_cast<std::size_t>(texture)].of_heights = true; }

  /// Says that a texture is one of vectors.
  void use_for_vectors(int texture) { requests_[static_cast<std::size_t>(texture)].of_vectors = true; }

  /// Intensities of a luminaire from a path beside the file. They are no texture, but read at once, each file once.
  /// @return  without rows: it is missing
  /// @error SceneError at `json_path`: there is no such file, or see ies_parse
  const IesProfile& add_ies(const GltfDocument& document, const std::string& uri, const std::string& json_path);

  /// A grid of an OpenVDB file beside the file, or an image of slices. Likewise read at once and once.
  /// @param grid  its name; of an image empty
  /// @param size  of an image, see voxels_load_slices
  /// @return  null: it is missing
  /// @error SceneError at `json_path`: there is no such file, or see voxels_load and voxels_load_slices; OutOfMemory
  std::shared_ptr<const Voxels> add_voxels(const GltfDocument& document,
                                           const std::string& uri,
                                           const std::string& grid,
                                           const std::array<int, 3>& size,
                                           const std::string& json_path);

  /// The files of luminaires and voxels, as they were before they were read.
  const std::vector<FileStamp>& files_read() const { return files_read_; }

  /// The requests, in index order; the table is empty afterwards.
  std::vector<TextureRequest> take();

 private:
  /// Image (file path, or document and image number) with everything that makes a request its own.
  using Key = std::tuple<std::string, const GltfDocument*, int, int, int, int, int>;
  static Key make_key(std::string file,
                      const GltfDocument* document,
                      int image,
                      TextureColor color,
                      TextureSampling sampling);
  int add(Key key, TextureRequest request, TextureColor color, TextureSampling sampling);

  /// Runs what may fail. @return whether it did not
  template <class Step>
  bool succeeds(const Step& step);

  TextureFaults* faults_ = nullptr;

  std::map<Key, int> index_of_;
  std::vector<TextureRequest> requests_;
  std::map<std::filesystem::path, IesProfile> ies_;
  /// By file, grid and size.
  std::map<std::tuple<std::filesystem::path, std::string, std::array<int, 3>>, std::shared_ptr<const Voxels>> voxels_;
  std::vector<FileStamp> files_read_;
};

}  // namespace relief
