// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_quarter_table: multiples of pi/2.
//
// Contract
//   value: -k pi/2 modulo 2, 56 bits after the point, a cycle after k, which is at most 256.
//
// Generated from rtl/src/tables; not to be edited.

module takt_quarter_table (
    input  wire clk,
    input  wire [8:0] k,
    output reg  [56:0] value
);

    reg [56:0] value_words [0:511];

    always @(posedge clk) begin
        value <= value_words[k];
    end

    initial begin
        value_words[0] = 57'h000000000000000; value_words[1] = 57'h06de04abbbd2e7c; value_words[2] = 57'h0dbc095777a5cf7; value_words[3] = 57'h149a0e033378b73;
        value_words[4] = 57'h1b7812aeef4b9ee; value_words[5] = 57'h0256175aab1e86a; value_words[6] = 57'h09341c0666f16e6; value_words[7] = 57'h101220b222c4561;
        value_words[8] = 57'h16f0255dde973dd; value_words[9] = 57'h1dce2a099a6a258; value_words[10] = 57'h04ac2eb5563d0d4; value_words[11] = 57'h0b8a3361120ff4f;
        value_words[12] = 57'h1268380ccde2dcb; value_words[13] = 57'h19463cb889b5c47; value_words[14] = 57'h002441644588ac2; value_words[15] = 57'h07024610015b93e;
        value_words[16] = 57'h0de04abbbd2e7b9; value_words[17] = 57'h14be4f677901635; value_words[18] = 57'h1b9c541334d44b1; value_words[19] = 57'h027a58bef0a732c;
        value_words[20] = 57'h09585d6aac7a1a8; value_words[21] = 57'h10366216684d023; value_words[22] = 57'h171466c2241fe9f; value_words[23] = 57'h1df26b6ddff2d1b;
        value_words[24] = 57'h04d070199bc5b96; value_words[25] = 57'h0bae74c55798a12; value_words[26] = 57'h128c7971136b88d; value_words[27] = 57'h196a7e1ccf3e709;
        value_words[28] = 57'h004882c88b11584; value_words[29] = 57'h0726877446e4400; value_words[30] = 57'h0e048c2002b727c; value_words[31] = 57'h14e290cbbe8a0f7;
        value_words[32] = 57'h1bc095777a5cf73; value_words[33] = 57'h029e9a23362fdee; value_words[34] = 57'h097c9ecef202c6a; value_words[35] = 57'h105aa37aadd5ae6;
        value_words[36] = 57'h1738a82669a8961; value_words[37] = 57'h1e16acd2257b7dd; value_words[38] = 57'h04f4b17de14e658; value_words[39] = 57'h0bd2b6299d214d4;
        value_words[40] = 57'h12b0bad558f4350; value_words[41] = 57'h198ebf8114c71cb; value_words[42] = 57'h006cc42cd09a047; value_words[43] = 57'h074ac8d88c6cec2;
        value_words[44] = 57'h0e28cd84483fd3e; value_words[45] = 57'h1506d2300412bb9; value_words[46] = 57'h1be4d6dbbfe5a35; value_words[47] = 57'h02c2db877bb88b1;
        value_words[48] = 57'h09a0e033378b72c; value_words[49] = 57'h107ee4def35e5a8; value_words[50] = 57'h175ce98aaf31423; value_words[51] = 57'h1e3aee366b0429f;
        value_words[52] = 57'h0518f2e226d711b; value_words[53] = 57'h0bf6f78de2a9f96; value_words[54] = 57'h12d4fc399e7ce12; value_words[55] = 57'h19b300e55a4fc8d;
        value_words[56] = 57'h009105911622b09; value_words[57] = 57'h076f0a3cd1f5985; value_words[58] = 57'h0e4d0ee88dc8800; value_words[59] = 57'h152b1394499b67c;
        value_words[60] = 57'h1c091840056e4f7; value_words[61] = 57'h02e71cebc141373; value_words[62] = 57'h09c521977d141ee; value_words[63] = 57'h10a3264338e706a;
        value_words[64] = 57'h17812aeef4b9ee6; value_words[65] = 57'h1e5f2f9ab08cd61; value_words[66] = 57'h053d34466c5fbdd; value_words[67] = 57'h0c1b38f22832a58;
        value_words[68] = 57'h12f93d9de4058d4; value_words[69] = 57'h19d742499fd8750; value_words[70] = 57'h00b546f55bab5cb; value_words[71] = 57'h07934ba1177e447;
        value_words[72] = 57'h0e71504cd3512c2; value_words[73] = 57'h154f54f88f2413e; value_words[74] = 57'h1c2d59a44af6fb9; value_words[75] = 57'h030b5e5006c9e35;
        value_words[76] = 57'h09e962fbc29ccb1; value_words[77] = 57'h10c767a77e6fb2c; value_words[78] = 57'h17a56c533a429a8; value_words[79] = 57'h1e8370fef615823;
        value_words[80] = 57'h056175aab1e869f; value_words[81] = 57'h0c3f7a566dbb51b; value_words[82] = 57'h131d7f02298e396; value_words[83] = 57'h19fb83ade561212;
        value_words[84] = 57'h00d98859a13408d; value_words[85] = 57'h07b78d055d06f09; value_words[86] = 57'h0e9591b118d9d85; value_words[87] = 57'h1573965cd4acc00;
        value_words[88] = 57'h1c519b08907fa7c; value_words[89] = 57'h032f9fb44c528f7; value_words[90] = 57'h0a0da4600825773; value_words[91] = 57'h10eba90bc3f85ee;
        value_words[92] = 57'h17c9adb77fcb46a; value_words[93] = 57'h1ea7b2633b9e2e6; value_words[94] = 57'h0585b70ef771161; value_words[95] = 57'h0c63bbbab343fdd;
        value_words[96] = 57'h1341c0666f16e58; value_words[97] = 57'h1a1fc5122ae9cd4; value_words[98] = 57'h00fdc9bde6bcb50; value_words[99] = 57'h07dbce69a28f9cb;
        value_words[100] = 57'h0eb9d3155e62847; value_words[101] = 57'h1597d7c11a356c2; value_words[102] = 57'h1c75dc6cd60853e; value_words[103] = 57'h0353e11891db3ba;
        value_words[104] = 57'h0a31e5c44dae235; value_words[105] = 57'h110fea7009810b1; value_words[106] = 57'h17edef1bc553f2c; value_words[107] = 57'h1ecbf3c78126da8;
        value_words[108] = 57'h05a9f8733cf9c23; value_words[109] = 57'h0c87fd1ef8cca9f; value_words[110] = 57'h136601cab49f91b; value_words[111] = 57'h1a4406767072796;
        value_words[112] = 57'h01220b222c45612; value_words[113] = 57'h08000fcde81848d; value_words[114] = 57'h0ede1479a3eb309; value_words[115] = 57'h15bc19255fbe185;
        value_words[116] = 57'h1c9a1dd11b91000; value_words[117] = 57'h0378227cd763e7c; value_words[118] = 57'h0a5627289336cf7; value_words[119] = 57'h11342bd44f09b73;
        value_words[120] = 57'h181230800adc9ef; value_words[121] = 57'h1ef0352bc6af86a; value_words[122] = 57'h05ce39d782826e6; value_words[123] = 57'h0cac3e833e55561;
        value_words[124] = 57'h138a432efa283dd; value_words[125] = 57'h1a6847dab5fb258; value_words[126] = 57'h01464c8671ce0d4; value_words[127] = 57'h082451322da0f50;
        value_words[128] = 57'h0f0255dde973dcb; value_words[129] = 57'h15e05a89a546c47; value_words[130] = 57'h1cbe5f356119ac2; value_words[131] = 57'h039c63e11cec93e;
        value_words[132] = 57'h0a7a688cd8bf7ba; value_words[133] = 57'h11586d389492635; value_words[134] = 57'h183671e450654b1; value_words[135] = 57'h1f1476900c3832c;
        value_words[136] = 57'h05f27b3bc80b1a8; value_words[137] = 57'h0cd07fe783de024; value_words[138] = 57'h13ae84933fb0e9f; value_words[139] = 57'h1a8c893efb83d1b;
        value_words[140] = 57'h016a8deab756b96; value_words[141] = 57'h084892967329a12; value_words[142] = 57'h0f2697422efc88d; value_words[143] = 57'h16049bedeacf709;
        value_words[144] = 57'h1ce2a099a6a2585; value_words[145] = 57'h03c0a5456275400; value_words[146] = 57'h0a9ea9f11e4827c; value_words[147] = 57'h117cae9cda1b0f7;
        value_words[148] = 57'h185ab34895edf73; value_words[149] = 57'h1f38b7f451c0def; value_words[150] = 57'h0616bca00d93c6a; value_words[151] = 57'h0cf4c14bc966ae6;
        value_words[152] = 57'h13d2c5f78539961; value_words[153] = 57'h1ab0caa3410c7dd; value_words[154] = 57'h018ecf4efcdf659; value_words[155] = 57'h086cd3fab8b24d4;
        value_words[156] = 57'h0f4ad8a67485350; value_words[157] = 57'h1628dd5230581cb; value_words[158] = 57'h1d06e1fdec2b047; value_words[159] = 57'h03e4e6a9a7fdec2;
        value_words[160] = 57'h0ac2eb5563d0d3e; value_words[161] = 57'h11a0f0011fa3bba; value_words[162] = 57'h187ef4acdb76a35; value_words[163] = 57'h1f5cf95897498b1;
        value_words[164] = 57'h063afe04531c72c; value_words[165] = 57'h0d1902b00eef5a8; value_words[166] = 57'h13f7075bcac2424; value_words[167] = 57'h1ad50c07869529f;
        value_words[168] = 57'h01b310b3426811b; value_words[169] = 57'h0891155efe3af96; value_words[170] = 57'h0f6f1a0aba0de12; value_words[171] = 57'h164d1eb675e0c8e;
        value_words[172] = 57'h1d2b236231b3b09; value_words[173] = 57'h0409280ded86985; value_words[174] = 57'h0ae72cb9a959800; value_words[175] = 57'h11c53165652c67c;
        value_words[176] = 57'h18a3361120ff4f7; value_words[177] = 57'h1f813abcdcd2373; value_words[178] = 57'h065f3f6898a51ef; value_words[179] = 57'h0d3d4414547806a;
        value_words[180] = 57'h141b48c0104aee6; value_words[181] = 57'h1af94d6bcc1dd61; value_words[182] = 57'h01d7521787f0bdd; value_words[183] = 57'h08b556c343c3a59;
        value_words[184] = 57'h0f935b6eff968d4; value_words[185] = 57'h1671601abb69750; value_words[186] = 57'h1d4f64c6773c5cb; value_words[187] = 57'h042d6972330f447;
        value_words[188] = 57'h0b0b6e1deee22c2; value_words[189] = 57'h11e972c9aab513e; value_words[190] = 57'h18c777756687fba; value_words[191] = 57'h1fa57c21225ae35;
        value_words[192] = 57'h068380ccde2dcb1; value_words[193] = 57'h0d6185789a00b2c; value_words[194] = 57'h143f8a2455d39a8; value_words[195] = 57'h1b1d8ed011a6824;
        value_words[196] = 57'h01fb937bcd7969f; value_words[197] = 57'h08d99827894c51b; value_words[198] = 57'h0fb79cd3451f396; value_words[199] = 57'h1695a17f00f2212;
        value_words[200] = 57'h1d73a62abcc508e; value_words[201] = 57'h0451aad67897f09; value_words[202] = 57'h0b2faf82346ad85; value_words[203] = 57'h120db42df03dc00;
        value_words[204] = 57'h18ebb8d9ac10a7c; value_words[205] = 57'h1fc9bd8567e38f7; value_words[206] = 57'h06a7c23123b6773; value_words[207] = 57'h0d85c6dcdf895ef;
        value_words[208] = 57'h1463cb889b5c46a; value_words[209] = 57'h1b41d034572f2e6; value_words[210] = 57'h021fd4e01302161; value_words[211] = 57'h08fdd98bced4fdd;
        value_words[212] = 57'h0fdbde378aa7e59; value_words[213] = 57'h16b9e2e3467acd4; value_words[214] = 57'h1d97e78f024db50; value_words[215] = 57'h0475ec3abe209cb;
        value_words[216] = 57'h0b53f0e679f3847; value_words[217] = 57'h1231f59235c66c3; value_words[218] = 57'h190ffa3df19953e; value_words[219] = 57'h1fedfee9ad6c3ba;
        value_words[220] = 57'h06cc0395693f235; value_words[221] = 57'h0daa084125120b1; value_words[222] = 57'h14880cece0e4f2c; value_words[223] = 57'h1b6611989cb7da8;
        value_words[224] = 57'h02441644588ac24; value_words[225] = 57'h09221af0145da9f; value_words[226] = 57'h10001f9bd03091b; value_words[227] = 57'h16de24478c03796;
        value_words[228] = 57'h1dbc28f347d6612; value_words[229] = 57'h049a2d9f03a948e; value_words[230] = 57'h0b78324abf7c309; value_words[231] = 57'h125636f67b4f185;
        value_words[232] = 57'h19343ba23722000; value_words[233] = 57'h0012404df2f4e7c; value_words[234] = 57'h06f044f9aec7cf8; value_words[235] = 57'h0dce49a56a9ab73;
        value_words[236] = 57'h14ac4e51266d9ef; value_words[237] = 57'h1b8a52fce24086a; value_words[238] = 57'h026857a89e136e6; value_words[239] = 57'h09465c5459e6561;
        value_words[240] = 57'h1024610015b93dd; value_words[241] = 57'h170265abd18c259; value_words[242] = 57'h1de06a578d5f0d4; value_words[243] = 57'h04be6f034931f50;
        value_words[244] = 57'h0b9c73af0504dcb; value_words[245] = 57'h127a785ac0d7c47; value_words[246] = 57'h19587d067caaac3; value_words[247] = 57'h003681b2387d93e;
        value_words[248] = 57'h0714865df4507ba; value_words[249] = 57'h0df28b09b023635; value_words[250] = 57'h14d08fb56bf64b1; value_words[251] = 57'h1bae946127c932d;
        value_words[252] = 57'h028c990ce39c1a8; value_words[253] = 57'h096a9db89f6f024; value_words[254] = 57'h1048a2645b41e9f; value_words[255] = 57'h1726a7101714d1b;
        value_words[256] = 57'h1e04abbbd2e7b96; value_words[257] = 57'h000000000000000; value_words[258] = 57'h000000000000000; value_words[259] = 57'h000000000000000;
        value_words[260] = 57'h000000000000000; value_words[261] = 57'h000000000000000; value_words[262] = 57'h000000000000000; value_words[263] = 57'h000000000000000;
        value_words[264] = 57'h000000000000000; value_words[265] = 57'h000000000000000; value_words[266] = 57'h000000000000000; value_words[267] = 57'h000000000000000;
        value_words[268] = 57'h000000000000000; value_words[269] = 57'h000000000000000; value_words[270] = 57'h000000000000000; value_words[271] = 57'h000000000000000;
        value_words[272] = 57'h000000000000000; value_words[273] = 57'h000000000000000; value_words[274] = 57'h000000000000000; value_words[275] = 57'h000000000000000;
        value_words[276] = 57'h000000000000000; value_words[277] = 57'h000000000000000; value_words[278] = 57'h000000000000000; value_words[279] = 57'h000000000000000;
        value_words[280] = 57'h000000000000000; value_words[281] = 57'h000000000000000; value_words[282] = 57'h000000000000000; value_words[283] = 57'h000000000000000;
        value_words[284] = 57'h000000000000000; value_words[285] = 57'h000000000000000; value_words[286] = 57'h000000000000000; value_words[287] = 57'h000000000000000;
        value_words[288] = 57'h000000000000000; value_words[289] = 57'h000000000000000; value_words[290] = 57'h000000000000000; value_words[291] = 57'h000000000000000;
        value_words[292] = 57'h000000000000000; value_words[293] = 57'h000000000000000; value_words[294] = 57'h000000000000000; value_words[295] = 57'h000000000000000;
        value_words[296] = 57'h000000000000000; value_words[297] = 57'h000000000000000; value_words[298] = 57'h000000000000000; value_words[299] = 57'h000000000000000;
        value_words[300] = 57'h000000000000000; value_words[301] = 57'h000000000000000; value_words[302] = 57'h000000000000000; value_words[303] = 57'h000000000000000;
        value_words[304] = 57'h000000000000000; value_words[305] = 57'h000000000000000; value_words[306] = 57'h000000000000000; value_words[307] = 57'h000000000000000;
        value_words[308] = 57'h000000000000000; value_words[309] = 57'h000000000000000; value_words[310] = 57'h000000000000000; value_words[311] = 57'h000000000000000;
        value_words[312] = 57'h000000000000000; value_words[313] = 57'h000000000000000; value_words[314] = 57'h000000000000000; value_words[315] = 57'h000000000000000;
        value_words[316] = 57'h000000000000000; value_words[317] = 57'h000000000000000; value_words[318] = 57'h000000000000000; value_words[319] = 57'h000000000000000;
        value_words[320] = 57'h000000000000000; value_words[321] = 57'h000000000000000; value_words[322] = 57'h000000000000000; value_words[323] = 57'h000000000000000;
        value_words[324] = 57'h000000000000000; value_words[325] = 57'h000000000000000; value_words[326] = 57'h000000000000000; value_words[327] = 57'h000000000000000;
        value_words[328] = 57'h000000000000000; value_words[329] = 57'h000000000000000; value_words[330] = 57'h000000000000000; value_words[331] = 57'h000000000000000;
        value_words[332] = 57'h000000000000000; value_words[333] = 57'h000000000000000; value_words[334] = 57'h000000000000000; value_words[335] = 57'h000000000000000;
        value_words[336] = 57'h000000000000000; value_words[337] = 57'h000000000000000; value_words[338] = 57'h000000000000000; value_words[339] = 57'h000000000000000;
        value_words[340] = 57'h000000000000000; value_words[341] = 57'h000000000000000; value_words[342] = 57'h000000000000000; value_words[343] = 57'h000000000000000;
        value_words[344] = 57'h000000000000000; value_words[345] = 57'h000000000000000; value_words[346] = 57'h000000000000000; value_words[347] = 57'h000000000000000;
        value_words[348] = 57'h000000000000000; value_words[349] = 57'h000000000000000; value_words[350] = 57'h000000000000000; value_words[351] = 57'h000000000000000;
        value_words[352] = 57'h000000000000000; value_words[353] = 57'h000000000000000; value_words[354] = 57'h000000000000000; value_words[355] = 57'h000000000000000;
        value_words[356] = 57'h000000000000000; value_words[357] = 57'h000000000000000; value_words[358] = 57'h000000000000000; value_words[359] = 57'h000000000000000;
        value_words[360] = 57'h000000000000000; value_words[361] = 57'h000000000000000; value_words[362] = 57'h000000000000000; value_words[363] = 57'h000000000000000;
        value_words[364] = 57'h000000000000000; value_words[365] = 57'h000000000000000; value_words[366] = 57'h000000000000000; value_words[367] = 57'h000000000000000;
        value_words[368] = 57'h000000000000000; value_words[369] = 57'h000000000000000; value_words[370] = 57'h000000000000000; value_words[371] = 57'h000000000000000;
        value_words[372] = 57'h000000000000000; value_words[373] = 57'h000000000000000; value_words[374] = 57'h000000000000000; value_words[375] = 57'h000000000000000;
        value_words[376] = 57'h000000000000000; value_words[377] = 57'h000000000000000; value_words[378] = 57'h000000000000000; value_words[379] = 57'h000000000000000;
        value_words[380] = 57'h000000000000000; value_words[381] = 57'h000000000000000; value_words[382] = 57'h000000000000000; value_words[383] = 57'h000000000000000;
        value_words[384] = 57'h000000000000000; value_words[385] = 57'h000000000000000; value_words[386] = 57'h000000000000000; value_words[387] = 57'h000000000000000;
        value_words[388] = 57'h000000000000000; value_words[389] = 57'h000000000000000; value_words[390] = 57'h000000000000000; value_words[391] = 57'h000000000000000;
        value_words[392] = 57'h000000000000000; value_words[393] = 57'h000000000000000; value_words[394] = 57'h000000000000000; value_words[395] = 57'h000000000000000;
        value_words[396] = 57'h000000000000000; value_words[397] = 57'h000000000000000; value_words[398] = 57'h000000000000000; value_words[399] = 57'h000000000000000;
        value_words[400] = 57'h000000000000000; value_words[401] = 57'h000000000000000; value_words[402] = 57'h000000000000000; value_words[403] = 57'h000000000000000;
        value_words[404] = 57'h000000000000000; value_words[405] = 57'h000000000000000; value_words[406] = 57'h000000000000000; value_words[407] = 57'h000000000000000;
        value_words[408] = 57'h000000000000000; value_words[409] = 57'h000000000000000; value_words[410] = 57'h000000000000000; value_words[411] = 57'h000000000000000;
        value_words[412] = 57'h000000000000000; value_words[413] = 57'h000000000000000; value_words[414] = 57'h000000000000000; value_words[415] = 57'h000000000000000;
        value_words[416] = 57'h000000000000000; value_words[417] = 57'h000000000000000; value_words[418] = 57'h000000000000000; value_words[419] = 57'h000000000000000;
        value_words[420] = 57'h000000000000000; value_words[421] = 57'h000000000000000; value_words[422] = 57'h000000000000000; value_words[423] = 57'h000000000000000;
        value_words[424] = 57'h000000000000000; value_words[425] = 57'h000000000000000; value_words[426] = 57'h000000000000000; value_words[427] = 57'h000000000000000;
        value_words[428] = 57'h000000000000000; value_words[429] = 57'h000000000000000; value_words[430] = 57'h000000000000000; value_words[431] = 57'h000000000000000;
        value_words[432] = 57'h000000000000000; value_words[433] = 57'h000000000000000; value_words[434] = 57'h000000000000000; value_words[435] = 57'h000000000000000;
        value_words[436] = 57'h000000000000000; value_words[437] = 57'h000000000000000; value_words[438] = 57'h000000000000000; value_words[439] = 57'h000000000000000;
        value_words[440] = 57'h000000000000000; value_words[441] = 57'h000000000000000; value_words[442] = 57'h000000000000000; value_words[443] = 57'h000000000000000;
        value_words[444] = 57'h000000000000000; value_words[445] = 57'h000000000000000; value_words[446] = 57'h000000000000000; value_words[447] = 57'h000000000000000;
        value_words[448] = 57'h000000000000000; value_words[449] = 57'h000000000000000; value_words[450] = 57'h000000000000000; value_words[451] = 57'h000000000000000;
        value_words[452] = 57'h000000000000000; value_words[453] = 57'h000000000000000; value_words[454] = 57'h000000000000000; value_words[455] = 57'h000000000000000;
        value_words[456] = 57'h000000000000000; value_words[457] = 57'h000000000000000; value_words[458] = 57'h000000000000000; value_words[459] = 57'h000000000000000;
        value_words[460] = 57'h000000000000000; value_words[461] = 57'h000000000000000; value_words[462] = 57'h000000000000000; value_words[463] = 57'h000000000000000;
        value_words[464] = 57'h000000000000000; value_words[465] = 57'h000000000000000; value_words[466] = 57'h000000000000000; value_words[467] = 57'h000000000000000;
        value_words[468] = 57'h000000000000000; value_words[469] = 57'h000000000000000; value_words[470] = 57'h000000000000000; value_words[471] = 57'h000000000000000;
        value_words[472] = 57'h000000000000000; value_words[473] = 57'h000000000000000; value_words[474] = 57'h000000000000000; value_words[475] = 57'h000000000000000;
        value_words[476] = 57'h000000000000000; value_words[477] = 57'h000000000000000; value_words[478] = 57'h000000000000000; value_words[479] = 57'h000000000000000;
        value_words[480] = 57'h000000000000000; value_words[481] = 57'h000000000000000; value_words[482] = 57'h000000000000000; value_words[483] = 57'h000000000000000;
        value_words[484] = 57'h000000000000000; value_words[485] = 57'h000000000000000; value_words[486] = 57'h000000000000000; value_words[487] = 57'h000000000000000;
        value_words[488] = 57'h000000000000000; value_words[489] = 57'h000000000000000; value_words[490] = 57'h000000000000000; value_words[491] = 57'h000000000000000;
        value_words[492] = 57'h000000000000000; value_words[493] = 57'h000000000000000; value_words[494] = 57'h000000000000000; value_words[495] = 57'h000000000000000;
        value_words[496] = 57'h000000000000000; value_words[497] = 57'h000000000000000; value_words[498] = 57'h000000000000000; value_words[499] = 57'h000000000000000;
        value_words[500] = 57'h000000000000000; value_words[501] = 57'h000000000000000; value_words[502] = 57'h000000000000000; value_words[503] = 57'h000000000000000;
        value_words[504] = 57'h000000000000000; value_words[505] = 57'h000000000000000; value_words[506] = 57'h000000000000000; value_words[507] = 57'h000000000000000;
        value_words[508] = 57'h000000000000000; value_words[509] = 57'h000000000000000; value_words[510] = 57'h000000000000000; value_words[511] = 57'h000000000000000;
    end

endmodule
