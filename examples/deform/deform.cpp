// SPDX-License-Identifier: MIT
// Deform the lungs of a basis file to one state, in C++:
//
//     deform_cpp lungs.safetensors prone:rest+500
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <supine/runtime.h>

// Lungs from a basis file. Errors are exceptions with the library's message.
class Lungs {
public:
  explicit Lungs(const std::string &path) {
    supine_basis *opened = nullptr;
    check(supine_basis_open(path.c_str(), &opened, &error));
    basis.reset(opened);
    positions.resize(3 * supine_basis_get_info(opened)->vertex_count);
  }

  // Return the positions [3 N] in a state such as "prone:rest+500", mm, LPS. The next call replaces
  // them.
  const std::vector<float> &deform(const std::string &text) {
    supine_state state = {};
    state.gravity[1] = 1; // supine, if the text names no posture
    supine_pose pose;
    check(supine_state_parse(text.c_str(), &state, &error));
    check(supine_basis_pose(basis.get(), &state, &pose, &error)); // once per frame
    supine_deform(basis.get(), &pose, positions.data());          // all vertices
    return positions;
  }

private:
  struct Close {
    void operator()(supine_basis *opened) const {
      supine_basis_close(opened);
    }
  };
  std::unique_ptr<supine_basis, Close> basis;
  std::vector<float> positions;
  supine_error error;

  void check(supine_status status) {
    if (status != SUPINE_OK) {
      throw std::runtime_error(error.message);
    }
  }
};

int main(int argc, char **argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: deform_cpp BASIS STATE\n");
    return 1;
  }
  try {
    Lungs lungs(argv[1]);
    const std::vector<float> &xyz = lungs.deform(argv[2]);
    std::printf("%zu vertices; the first is at %g %g %g mm\n", xyz.size() / 3, xyz[0], xyz[1],
                xyz[2]);
  } catch (const std::exception &failure) {
    std::fprintf(stderr, "%s\n", failure.what());
    return 2;
  }
  return 0;
}
