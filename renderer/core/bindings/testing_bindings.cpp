#include "bindings/arrays.hpp"
namespace primray {
void bind_testing(nb::module_&) {}
}  // namespace primray
