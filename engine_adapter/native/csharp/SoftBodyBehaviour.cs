// Unity component that draws a body of a SoftWorldBehaviour's world.
//
// Not tested in Unity: tests compile it with Mono against stubs/UnityEngine.cs and run it.
using System;
using System.Runtime.InteropServices;
using UnityEngine;
using UnityEngine.Rendering;

namespace TaichiSoft
{
    /// <summary>Updates the mesh of this game object from a body, once per frame.</summary>
    [RequireComponent(typeof(MeshFilter))]
    public sealed class SoftBodyBehaviour : MonoBehaviour
    {
        [SerializeField, Tooltip("World of the body")]
        private SoftWorldBehaviour world = null;

        [SerializeField, Tooltip("Name of the body in the world file")]
        private string body = "body0";

        [SerializeField, Tooltip("Name of the mesh in the world file; empty takes the first mesh of the body's asset")]
        private string mesh = "";

        // A Unity mesh, and the memory that the library writes to.
        private sealed class Drawing
        {
            public readonly Mesh Mesh;
            private readonly int number;
            private readonly Vector3[] vertices, normals;
            private GCHandle vertexMemory, normalMemory; // pinned, because the library writes to it directly

            public Drawing(Scene scene, int number, string name)
            {
                this.number = number;
                MeshInfo info = scene.GetMeshInfo(number);
                vertices = new Vector3[info.VertexCount];
                normals = new Vector3[info.VertexCount];
                vertexMemory = GCHandle.Alloc(vertices, GCHandleType.Pinned);
                normalMemory = GCHandle.Alloc(normals, GCHandleType.Pinned);
                Mesh = new Mesh { name = name };
                Mesh.MarkDynamic();
                Mesh.indexFormat = info.VertexCount > 65535 ? IndexFormat.UInt32 : IndexFormat.UInt16;
                Mesh.vertices = vertices;
                if (info.HasUv) Mesh.uv = UvOf(scene, info);
                var triangles = new int[3 * info.TriangleCount];
                scene.GetTriangles(number, triangles);
                Mesh.triangles = triangles;
            }

            private Vector2[] UvOf(Scene scene, MeshInfo info)
            {
                var numbers = new float[2 * info.VertexCount];
                scene.GetUv(number, numbers);
                var uv = new Vector2[info.VertexCount];
                for (int i = 0; i < uv.Length; ++i) uv[i] = new Vector2(numbers[2 * i], numbers[2 * i + 1]);
                return uv;
            }

            public void Read(Body body)
            {
                body.ReadMesh(
                    number, vertexMemory.AddrOfPinnedObject(), normalMemory.AddrOfPinnedObject(), 3 * vertices.Length);
                Fill();
            }

            public void Clear()
            {
                Array.Clear(vertices, 0, vertices.Length); // degenerate triangles are invisible
                Fill();
            }

            private void Fill()
            {
                Mesh.vertices = vertices;
                Mesh.normals = normals;
                Mesh.RecalculateBounds();
            }

            public void Release()
            {
                if (vertexMemory.IsAllocated) vertexMemory.Free();
                if (normalMemory.IsAllocated) normalMemory.Free();
                Destroy(Mesh);
            }
        }

        private int slot;
        // Drawings by level of detail, so that a change of level allocates nothing. A skin is used for all levels.
        private Drawing[] drawings = new Drawing[0];
        private Drawing shown;
        private MeshFilter filter;
        private bool isSomebody = true;

        /// <summary>The body. Check IsSomebody, because the slot can be empty.</summary>
        public Body Body
        {
            get { return world.World.GetBody(slot); }
        }

        private void Start()
        {
            Scene scene = world.Scene;
            slot = scene.Find(NameKind.Body, body);
            int number = mesh.Length > 0 ? scene.Find(NameKind.Mesh, mesh) : FirstMesh(scene);
            if (scene.GetMeshLevel(number) < 0)
            {
                drawings = new[] { new Drawing(scene, number, body) };
            }
            else
            {
                AddLevels(scene, scene.GetMeshInfo(number).Asset);
            }
            filter = GetComponent<MeshFilter>();
            Show(drawings[0]);
            // The library writes world coordinates, so the transform must be the identity.
            transform.SetPositionAndRotation(Vector3.zero, Quaternion.identity);
        }

        private void AddLevels(Scene scene, int asset)
        {
            drawings = new Drawing[scene.GetLevelCount(asset)];
            int count = scene.GetInfo().MeshCount;
            for (int i = 0; i < count; ++i)
            {
                if (scene.GetMeshInfo(i).Asset == asset) drawings[scene.GetMeshLevel(i)] = new Drawing(scene, i, body);
            }
        }

        private void Show(Drawing drawing)
        {
            if (shown == drawing) return;
            shown = drawing;
            filter.sharedMesh = drawing.Mesh;
        }

        private int FirstMesh(Scene scene)
        {
            Body found = Body;
            if (!found.IsSomebody)
            {
                throw new SoftException(ErrorCode.State, "slot " + body + " is empty at the start: set the mesh's name");
            }
            int asset = found.GetAsset(), count = scene.GetInfo().MeshCount;
            for (int i = 0; i < count; ++i)
            {
                if (scene.GetMeshInfo(i).Asset == asset) return i;
            }
            throw new SoftException(ErrorCode.Argument, "there is no mesh of " + body);
        }

        // Runs after SoftWorldBehaviour.Update, which sets alpha.
        private void LateUpdate()
        {
            if (shown == null || world.World == null) return;
            Body found = Body;
            if (found.IsSomebody)
            {
                Show(drawings.Length > 1 ? drawings[found.Level] : drawings[0]);
                shown.Read(found);
            }
            else if (isSomebody)
            {
                shown.Clear();
            }
            isSomebody = found.IsSomebody;
        }

        private void OnDestroy()
        {
            foreach (Drawing each in drawings)
            {
                if (each != null) each.Release();
            }
            drawings = new Drawing[0];
            shown = null;
        }
    }
}
