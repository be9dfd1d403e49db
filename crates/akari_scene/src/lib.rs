//! glTF scenes as plain, validated data: meshes, materials, textures, lights and cameras.
