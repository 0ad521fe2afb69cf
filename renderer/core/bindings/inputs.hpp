// Python classes of the builder's inputs: an attribute per field. Arrays stay alive with the input that refers to them.
#pragma once

#include "bindings/arrays.hpp"
#include "math/vec3.hpp"

namespace primray {

// Numbers that Python hands over in a sequence: a tuple, a list or an array.
template <class T>
using Numbers = nb::typed<nb::sequence, T>;

inline vec3 vec3_of(const nb::handle& h) { return {nb::cast<float>(h[0]), nb::cast<float>(h[1]), nb::cast<float>(h[2])}; }
inline dvec3 dvec3_of(const nb::handle& h) { return {nb::cast<double>(h[0]), nb::cast<double>(h[1]), nb::cast<double>(h[2])}; }

// Attributes are set by Python and read by the builder alone.
template <class Class, class Owner>
void def_vec3(nb::class_<Class>& c, const char* name, vec3 Owner::* field) {
  c.def_prop_rw(name, nullptr, [field](Class& s, Numbers<float> v) { s.*field = vec3_of(v); });
}
template <class Class, class Owner, class T, size_t N>
void def_numbers(nb::class_<Class>& c, const char* name, T (Owner::*field)[N]) {
  c.def_prop_rw(name, nullptr, [field](Class& s, Numbers<T> v) {
    for (size_t i = 0; i < N; ++i) (s.*field)[i] = nb::cast<T>(v[i]);
  });
}
template <class Class, class Owner>
void def_matrix(nb::class_<Class>& c, const char* name, daffine Owner::* field) {
  c.def_prop_rw(name, nullptr, [field](Class& s, InArray<double> m) { s.*field = affine_of(m); });
}
template <class Class, class T, class Owner>
void def_array(nb::class_<Class>& c, const char* name, InArray<T> Class::* held, std::span<const T> Owner::* field) {
  c.def_prop_rw(name, nullptr, [held, field](Class& s, InArray<T> a) {
    s.*held = std::move(a);
    s.*field = span_of(s.*held);
  });
}

}  // namespace primray
