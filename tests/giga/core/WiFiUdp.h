// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Arduino.h>

namespace arduino {

class WiFiUDP {
 public:
  WiFiUDP();
  virtual ~WiFiUDP();
  virtual std::uint8_t begin(std::uint16_t port);
  virtual void stop();
  virtual int beginPacket(IPAddress ip, std::uint16_t port);
  virtual int endPacket();
  virtual std::size_t write(const std::uint8_t* buffer, std::size_t size);
  virtual int parsePacket();
  virtual int read(char* buffer, std::size_t size);
  virtual IPAddress remoteIP();
  virtual std::uint16_t remotePort();

 private:
  unsigned char* packet_;
};

}  // namespace arduino
