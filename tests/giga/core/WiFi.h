// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Arduino.h>

class NetworkInterface;

enum wl_enc_type { ENC_TYPE_NONE = 7, ENC_TYPE_UNKNOWN = 9 };
enum wl_status_t { WL_IDLE_STATUS = 0, WL_CONNECTED = 3, WL_CONNECT_FAILED = 4 };

namespace arduino {

class WiFiClass {
 public:
  int begin(const char* ssid);  // reads 64 bytes at address 0 as its password
  int begin(const char* ssid, const char* passphrase, wl_enc_type security = ENC_TYPE_UNKNOWN);
  int disconnect();
  std::uint8_t status();
  IPAddress localIP();
  NetworkInterface* getNetwork();
};

}  // namespace arduino

extern arduino::WiFiClass WiFi;
