// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "r4link/discovery/discover.hpp"
#include "record.hpp"

namespace r4::python {
namespace {

std::optional<std::string> text_of(const std::optional<Problem>& trouble) {
  return trouble ? std::optional(trouble->text()) : std::nullopt;
}

py::object holder_of(const FoundBoard& board) {
  if (!board.holder) return py::none();
  return py::module_::import("r4link.errors")
      .attr("Program")(board.holder->pid, printable(board.holder->name));
}

}  // namespace

void bind_discovery(py::module_& module) {
  Record<FoundBoard>(module, "FoundBoard")
      .has("url", &FoundBoard::url)
      .has("place", &FoundBoard::place)
      .has("address", &FoundBoard::address)
      .has("node", [](const FoundBoard& board) { return static_cast<int>(board.node); })
      .has("identity", &FoundBoard::identity)
      .has("busy", &FoundBoard::busy)
      .has("holder", holder_of)
      .has("holder_controls", &FoundBoard::holder_controls)
      .has("foreign_frames", &FoundBoard::foreign_frames);
  Record<SearchedPort>(module, "SearchedPort")
      .has("path", &SearchedPort::path)
      .has("url", &SearchedPort::url)
      .has("usb_id", &SearchedPort::usb_id)
      .has("serial_number", [](const SearchedPort& port) { return printable(port.serial_number); })
      .has("description", [](const SearchedPort& port) { return printable(port.description); })
      .has("is_r4", &SearchedPort::is_r4)
      .has("asked", &SearchedPort::asked)
      .has("trouble", [](const SearchedPort& port) { return text_of(port.trouble); });
  Record<SearchedBus>(module, "SearchedBus")
      .has("interface", &SearchedBus::interface)
      .has("up", &SearchedBus::up)
      .has("fd", &SearchedBus::fd)
      .has("has_controller", &SearchedBus::has_controller)
      .has("state", &SearchedBus::state)
      .has("bit_rate", &SearchedBus::bit_rate)
      .has("trouble", [](const SearchedBus& bus) { return text_of(bus.trouble); });
  Record<SearchedNetwork>(module, "SearchedNetwork")
      .has("interface", &SearchedNetwork::interface)
      .has("address", &SearchedNetwork::address)
      .has("trouble", [](const SearchedNetwork& network) { return text_of(network.trouble); });
  py::class_<Discovery>(module, "Discovery")
      .def(pickled<Discovery>("Discovery"))
      .def_readonly("boards", &Discovery::boards)
      .def_readonly("ports", &Discovery::ports)
      .def_readonly("buses", &Discovery::buses)
      .def_readonly("networks", &Discovery::networks)
      .def_readonly("more", &Discovery::more)
      .def("only", &Discovery::only);
  module.def(
      "discover",
      [](bool serial, bool can, bool udp, const std::vector<std::string>& serial_ports,
         std::uint16_t udp_port) {
        return discover({serial, can, udp, serial_ports, udp_port});
      },
      py::kw_only(), py::arg("serial") = true, py::arg("can") = true, py::arg("udp") = true,
      py::arg("serial_ports") = std::vector<std::string>(),
      py::arg("udp_port") = DiscoveryOptions().udp_port, py::call_guard<py::gil_scoped_release>());
}

}  // namespace r4::python
