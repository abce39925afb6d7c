// SPDX-License-Identifier: GPL-3.0-or-later
#include "page_request.hpp"

#include <array>
#include <string_view>
#include <utility>

#include "../shell/json.hpp"
#include "r4link/datagram.hpp"

namespace r4::tool::web {
namespace {

using Kind = PageRequest::Kind;

constexpr std::array<std::pair<std::string_view, Kind>, 7> kinds{{{"control", Kind::control},
                                                                  {"alive", Kind::alive},
                                                                  {"command", Kind::command},
                                                                  {"arm", Kind::arm},
                                                                  {"clear", Kind::clear},
                                                                  {"stop", Kind::stop},
                                                                  {"record", Kind::record}}};

bool read(const Json& object, const char* name, bool& out) {
  const auto found = object.find(name);
  if (found == object.end() || !found->is_boolean()) return false;
  out = found->get<bool>();
  return true;
}

template <class Number>
bool read_number(const Json& object, const char* name, Number& out) {
  const auto found = object.find(name);
  if (found == object.end() || !found->is_number_unsigned()) return false;
  out = found->get<Number>();
  return true;
}

bool read_command(const Json& object, std::string& out) {
  const auto found = object.find("command");
  if (found == object.end() || !found->is_string()) return false;
  out = found->get<std::string>();
  return !out.empty() && out.size() <= max_datagram;
}

}  // namespace

std::optional<PageRequest> page_request(const std::string& text) {
  const Json object = Json::parse(text, nullptr, false);
  if (!object.is_object()) return std::nullopt;
  const auto type = object.find("type");
  if (type == object.end() || !type->is_string()) return std::nullopt;
  PageRequest request;
  bool known = false;
  for (const auto& [name, kind] : kinds) {
    if (type->get_ref<const std::string&>() != name) continue;
    request.kind = kind;
    known = true;
  }
  if (!known) return std::nullopt;
  bool good = false;
  switch (request.kind) {
    case Kind::control:
      good = read(object, "want", request.on);
      break;
    case Kind::record:
      good = read(object, "on", request.on);
      break;
    case Kind::alive:
      good = read_number(object, "now", request.now);
      break;
    case Kind::command:
      good = read_number(object, "request", request.request) &&
             read_number(object, "board", request.board) && read_command(object, request.command);
      break;
    case Kind::arm:
    case Kind::clear:
      good = read_number(object, "request", request.request) &&
             read_number(object, "board", request.board);
      break;
    case Kind::stop:  // a stop is obeyed even if other members are wrong
      read_number(object, "request", request.request);
      good = true;
      break;
  }
  return good ? std::optional(std::move(request)) : std::nullopt;
}

}  // namespace r4::tool::web
