-- PROFIBUS DP for Wireshark: reads the telegrams of flight.pcapng, which isodp wrote beside this file.
--
-- Once:    wireshark -X lua_script:profibus_dp.lua flight.pcapng
--          tshark    -X lua_script:profibus_dp.lua -r flight.pcapng -V
-- Always:  copy this file into the folder that Wireshark names under Help, About, Folders, "Personal Lua Plugins".
--
-- It registers for the link type USER0 (147). Filters: profibus.da == 3, profibus.service == "Data_Exchange",
-- profibus.tlg81.zsw2.life == 7, profibus.gc.synch, frame.comment contains "TRIGGER".
--
-- A packet is a telegram from its start delimiter to its end delimiter (EN 50170-2):
--   SD1 10 DA SA FC FCS 16                     SD2 68 LE LEr 68 DA SA FC [DSAP] [SSAP] DU FCS 16
--   SD3 A2 DA SA FC [DSAP] [SSAP] DU FCS 16    SD4 DC DA SA            SC E5

local profibus = Proto("profibus", "PROFIBUS DP")

local DELIMITERS = {
  [0x10] = "SD1, no data", [0x68] = "SD2, variable length", [0xA2] = "SD3, 8 octets of data", [0xDC] = "SD4, token",
  [0xE5] = "SC, short acknowledgement",
}
-- Bits 3 to 0 of FC, with bit 7 where it matters.
local REQUESTS = {
  [0x00] = "Time_Event", [0x03] = "SDA low", [0x04] = "SDN low", [0x05] = "SDA high", [0x06] = "SDN high", [0x07] = "MSRD",
  [0x09] = "FDL status", [0x0C] = "SRD low", [0x0D] = "SRD high", [0x0E] = "Ident", [0x0F] = "LSAP status",
  [0x80] = "Clock_Value",
}
local RESPONSES = {
  [0x00] = "OK, positive acknowledgement", [0x01] = "UE, user error", [0x02] = "RR, no resources",
  [0x03] = "RS, service access point not activated", [0x08] = "DL, data low", [0x09] = "NR, no data ready",
  [0x0A] = "DH, data high", [0x0C] = "RDL, data low, but no resources", [0x0D] = "RDH, data high, but no resources",
}
local STATIONS = {
  [0] = "slave", [1] = "master, not ready", [2] = "master, ready for the ring", [3] = "master, in the ring",
}
-- Service access points of a slave (EN 50170-2, DP-V1).
local SAPS = {
  [49] = "MS2 resource manager", [50] = "MS1 alarm", [51] = "MS1", [53] = "Ext_User_Prm", [54] = "master-master",
  [55] = "Set_Slave_Add", [56] = "RD_Inp", [57] = "RD_Outp", [58] = "Global_Control", [59] = "Get_Cfg",
  [60] = "Slave_Diag", [61] = "Set_Prm", [62] = "Chk_Cfg",
}
local MASTER_SAPS = { [50] = "master, MS2", [51] = "master, MS1", [54] = "master-master", [62] = "master, MS0" }
local COMMANDS = { { 0x20, "Sync" }, { 0x10, "Unsync" }, { 0x08, "Freeze" }, { 0x04, "Unfreeze" } }

local f = {
  sd = ProtoField.uint8("profibus.sd", "Start delimiter", base.HEX, DELIMITERS),
  le = ProtoField.uint8("profibus.le", "LE, length", base.DEC),
  ler = ProtoField.uint8("profibus.ler", "LEr, length repeated", base.DEC),
  sd_again = ProtoField.uint8("profibus.sd_again", "Start delimiter repeated", base.HEX),
  da = ProtoField.uint8("profibus.da", "DA, destination", base.DEC, nil, 0x7F),
  da_ext = ProtoField.bool("profibus.da.extended", "DSAP follows", 8, nil, 0x80),
  sa = ProtoField.uint8("profibus.sa", "SA, source", base.DEC, nil, 0x7F),
  sa_ext = ProtoField.bool("profibus.sa.extended", "SSAP follows", 8, nil, 0x80),
  fc = ProtoField.uint8("profibus.fc", "FC, frame control", base.HEX),
  request = ProtoField.bool("profibus.fc.request", "Request", 8, nil, 0x40),
  fcb = ProtoField.bool("profibus.fc.fcb", "FCB, frame count bit", 8, nil, 0x20),
  fcv = ProtoField.bool("profibus.fc.fcv", "FCV, frame count bit valid", 8, nil, 0x10),
  station = ProtoField.uint8("profibus.fc.station", "Station type", base.DEC, STATIONS, 0x30),
  fc_request = ProtoField.uint8("profibus.fc.function", "Function", base.HEX, REQUESTS, 0x8F),
  fc_response = ProtoField.uint8("profibus.fc.status", "Status", base.HEX, RESPONSES, 0x0F),
  dsap = ProtoField.uint8("profibus.dsap", "DSAP", base.DEC),
  ssap = ProtoField.uint8("profibus.ssap", "SSAP", base.DEC),
  service = ProtoField.string("profibus.service", "Service"),
  du = ProtoField.bytes("profibus.du", "DU, data unit"),
  fcs = ProtoField.uint8("profibus.fcs", "FCS, check octet", base.HEX),
  fcs_good = ProtoField.bool("profibus.fcs.good", "FCS right"),
  ed = ProtoField.uint8("profibus.ed", "End delimiter", base.HEX),
  gc_command = ProtoField.uint8("profibus.gc.command", "Control command", base.HEX),
  gc_words = ProtoField.string("profibus.gc.words", "Command"),
  gc_groups = ProtoField.uint8("profibus.gc.groups", "Group select", base.HEX),
  gc_synch = ProtoField.bool("profibus.gc.synch", "SYNCH, the clock"),
  stw2 = ProtoField.uint16("profibus.tlg81.stw2", "STW2", base.HEX),
  stw2_life = ProtoField.uint16("profibus.tlg81.stw2.life", "Master's sign of life", base.DEC, nil, 0xF000),
  g1_stw = ProtoField.uint16("profibus.tlg81.g1_stw", "G1_STW, sensor control word", base.HEX),
  zsw2 = ProtoField.uint16("profibus.tlg81.zsw2", "ZSW2", base.HEX),
  zsw2_life = ProtoField.uint16("profibus.tlg81.zsw2.life", "Slave's sign of life", base.DEC, nil, 0xF000),
  g1_zsw = ProtoField.uint16("profibus.tlg81.g1_zsw", "G1_ZSW, sensor status word", base.HEX),
  xist1 = ProtoField.uint32("profibus.tlg81.g1_xist1", "G1_XIST1, position", base.HEX),
  xist2 = ProtoField.uint32("profibus.tlg81.g1_xist2", "G1_XIST2, position or fault code", base.HEX),
}
profibus.fields = f

-- Bits of the sensor words (PROFIdrive, telegram 81).
local ACKNOWLEDGE, ERROR = 0x8000, 0x8000

local bad = ProtoExpert.new("profibus.bad", "Telegram that no station takes", expert.group.MALFORMED, expert.severity.ERROR)
profibus.experts = { bad }

local function has(octet, mask)
  return math.floor(octet / mask) % 2 == 1
end

-- Global_Control: two octets.
local function global_control(du, tree)
  if du:len() ~= 2 then return "Global_Control" end
  local command, groups = du(0, 1):uint(), du(1, 1):uint()
  local words = { has(command, 0x02) and "Clear" or "Operate" }
  for _, pair in ipairs(COMMANDS) do
    if has(command, pair[1]) then words[#words + 1] = pair[2] end
  end
  local text, synch = table.concat(words, " "), command == 0 and groups == 0x80
  tree:add(f.gc_command, du(0, 1))
  tree:add(f.gc_words, du(0, 1), text)
  tree:add(f.gc_groups, du(1, 1))
  tree:add(f.gc_synch, du, synch)
  if synch then return "Global_Control SYNCH" end
  local chosen = {}
  for group = 1, 8 do
    if has(groups, 2 ^ (group - 1)) then chosen[#chosen + 1] = tostring(group) end
  end
  local to = #chosen == 0 and "all slaves" or "groups " .. table.concat(chosen, " ")
  return "Global_Control " .. text .. ", " .. to
end

-- Data_Exchange: telegram 81 where the length is its own, 4 octets out and 12 in (PROFIdrive).
local function data_exchange(du, tree, request)
  if request and du:len() == 4 then
    local t = tree:add(profibus, du, "Telegram 81, outputs")
    t:add(f.stw2, du(0, 2))
    t:add(f.stw2_life, du(0, 2))
    t:add(f.g1_stw, du(2, 2))
    local more = has(du(2, 2):uint(), ACKNOWLEDGE) and ", acknowledges" or ""
    return string.format("Data_Exchange: sign of life %d, G1_STW %04X%s", du(0, 1):bitfield(0, 4), du(2, 2):uint(), more)
  elseif not request and du:len() == 12 then
    local t = tree:add(profibus, du, "Telegram 81, inputs")
    t:add(f.zsw2, du(0, 2))
    t:add(f.zsw2_life, du(0, 2))
    t:add(f.g1_zsw, du(2, 2))
    t:add(f.xist1, du(4, 4))
    t:add(f.xist2, du(8, 4))
    local more = has(du(2, 2):uint(), ERROR) and string.format(", fault %04X", du(8, 4):uint()) or ""
    return string.format("Data_Exchange: sign of life %d, G1_ZSW %04X, XIST1 %08X, XIST2 %08X%s", du(0, 1):bitfield(0, 4),
      du(2, 2):uint(), du(4, 4):uint(), du(8, 4):uint(), more)
  end
  return du:len() == 0 and "Data_Exchange" or string.format("Data_Exchange, %d octets", du:len())
end

-- The SAP of the slave names the service: that of the destination in a request, of the source in a response.
local function name(sap)
  if sap <= 48 then return "MS2 connection " .. sap end
  return SAPS[sap] or ("SAP " .. sap)
end
local function add_sap(tree, field, octet, of_slave)
  local sap = octet:uint() % 64
  local text = of_slave and name(sap) or MASTER_SAPS[sap] or "not assigned"
  tree:add(field, octet, sap):append_text(" (" .. text .. ")")
  return sap
end

local function add_fc(tree, octet)
  local fc, value = tree:add(f.fc, octet), octet:uint()
  local request = has(value, 0x40)
  fc:add(f.request, octet)
  if request then
    fc:add(f.fcb, octet)
    fc:add(f.fcv, octet)
    fc:add(f.fc_request, octet)
    local words = REQUESTS[value % 16 + (has(value, 0x80) and 0x80 or 0)] or "reserved"
    if has(value, 0x10) then words = words .. (has(value, 0x20) and ", FCB 1" or ", FCB 0") end
    if has(value, 0x20) and not has(value, 0x10) then words = words .. ", first" end
    fc:append_text(" (request, " .. words .. ")")
    return request, words, value % 16
  end
  fc:add(f.station, octet)
  fc:add(f.fc_response, octet)
  local words = RESPONSES[value % 16] or "reserved"
  fc:append_text(" (response of a " .. STATIONS[math.floor(value / 16) % 4] .. ", " .. words .. ")")
  return request, words, value % 16
end

-- From DA to the last octet before FCS: what SD1, SD2 and SD3 have in common. Returns the words for the list.
local function body(octets, tree, pinfo)
  local da, sa = octets(0, 1), octets(1, 1)
  tree:add(f.da, da)
  tree:add(f.da_ext, da)
  tree:add(f.sa, sa)
  tree:add(f.sa_ext, sa)
  pinfo.cols.src, pinfo.cols.dst = tostring(sa:uint() % 128), tostring(da:uint() % 128)
  local request, words, code = add_fc(tree, octets(2, 1))
  local at, dsap, ssap = 3, nil, nil
  if has(da:uint(), 0x80) and octets:len() > at then
    dsap, at = add_sap(tree, f.dsap, octets(at, 1), request), at + 1
  end
  if has(sa:uint(), 0x80) and octets:len() > at then
    ssap, at = add_sap(tree, f.ssap, octets(at, 1), not request), at + 1
  end
  local empty = octets:len() == at
  local du = empty and octets(0, 0) or octets(at)
  if not empty then tree:add(f.du, du) end
  local sap = request and dsap or ssap
  if not request then sap = ssap end
  local service, text
  if request and (code == 0x09 or code == 0x0E or code == 0x0F) then
    service, text = words, words
  elseif sap == 58 then
    service, text = "Global_Control", global_control(du, tree)
  elseif sap then
    service = name(sap)
    text = empty and service or string.format("%s, %d octets", service, du:len())
  elseif not request and empty then
    service, text = "acknowledgement", "status of a " .. STATIONS[math.floor(octets(2, 1):uint() / 16) % 4]
  else
    service, text = "Data_Exchange", empty and "Data_Exchange" or data_exchange(du, tree, request)
  end
  tree:add(f.service, octets, service):set_generated()
  return (request and "-> " or "<- ") .. text .. " [" .. words .. "]"
end

-- FCS is the sum of all octets from DA on.
local function trailer(tvb, tree, from, len)
  local sum = 0
  for at = from, from + len - 1 do sum = sum + tvb(at, 1):uint() end
  local fcs, ed = tvb(from + len, 1), tvb(from + len + 1, 1)
  local good = fcs:uint() == sum % 256
  tree:add(f.fcs, fcs)
  tree:add(f.fcs_good, fcs, good):set_generated()
  tree:add(f.ed, ed)
  if not good then
    tree:add_proto_expert_info(bad, string.format("FCS is %02X, the octets make %02X", fcs:uint(), sum % 256))
  end
  if ed:uint() ~= 0x16 then tree:add_proto_expert_info(bad, "the end delimiter is not 16") end
  return good and ed:uint() == 0x16
end

local function cut(tree, pinfo)
  tree:add_proto_expert_info(bad, "the telegram's length is none of its kind")
  pinfo.cols.info = "unreadable: wrong length"
end

-- A telegram whose header begins at `from` and has `len` octets up to its FCS.
local function data(tvb, tree, pinfo, from, len)
  if len < 3 or tvb:len() ~= from + len + 2 then return cut(tree, pinfo) end
  local words = body(tvb(from, len), tree, pinfo)
  pinfo.cols.info = (trailer(tvb, tree, from, len) and "" or "UNREADABLE ") .. words
end

function profibus.dissector(tvb, pinfo, root)
  if tvb:len() == 0 then return 0 end
  pinfo.cols.protocol = "PROFIBUS"
  local tree, sd = root:add(profibus, tvb()), tvb(0, 1)
  tree:add(f.sd, sd)
  local kind = sd:uint()
  if kind == 0xE5 then
    pinfo.cols.info = "<- SC"
  elseif kind == 0xDC and tvb:len() == 3 then
    local da, sa = tvb(1, 1), tvb(2, 1)
    tree:add(f.da, da)
    tree:add(f.sa, sa)
    tree:add(f.service, tvb(), "token"):set_generated()
    pinfo.cols.src, pinfo.cols.dst = tostring(sa:uint()), tostring(da:uint())
    pinfo.cols.info = sa:uint() == da:uint() and "token to itself" or "token"
  elseif kind == 0x10 then
    data(tvb, tree, pinfo, 1, 3)
  elseif kind == 0xA2 then
    data(tvb, tree, pinfo, 1, 11)
  elseif kind == 0x68 and tvb:len() >= 4 then
    tree:add(f.le, tvb(1, 1))
    tree:add(f.ler, tvb(2, 1))
    tree:add(f.sd_again, tvb(3, 1))
    if tvb(1, 1):uint() ~= tvb(2, 1):uint() or tvb(3, 1):uint() ~= 0x68 then
      tree:add_proto_expert_info(bad, "LE and LEr, or both start delimiters, differ")
    end
    data(tvb, tree, pinfo, 4, tvb(1, 1):uint())
  else
    cut(tree, pinfo)
  end
  return tvb:len()
end

DissectorTable.get("wtap_encap"):add(wtap.USER0, profibus)
