// Exception of the core: thrown while a scene is built and before a pass begins, never by its kernels.
#pragma once

#include <stdexcept>
#include <string>

namespace primray {

struct Error : std::runtime_error {
  std::string code;
  Error(std::string code_, const std::string& message) : std::runtime_error(message), code(std::move(code_)) {}
};

}  // namespace primray
